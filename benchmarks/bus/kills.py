"""The master killed (SIGKILL) or stopped (SIGSTOP) while four winches move: do the drives stop by themselves?

The drives watch the host's heartbeat (1016) and quick-stop where it fails to come (6007, 605A). In time means: at rest
within the configured heartbeat time plus the ramp from the speed of the move, counted from the signal, or from the last
heartbeat where the simulators' own process took that from its socket later. A stopped master is woken afterwards:
nothing may move again. Times are the simulated drives' own, from their shafts; SLCAN over TCP.
"""

import asyncio
import multiprocessing
import os
import random
import signal
import threading
import time
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from multiprocessing.connection import Connection

import numpy as np

from benchmarks.bus.devices import NODES, Witness, simulated_drives, winch_config
from benchmarks.page import table
from drivers.canbus.python_can import PythonCanTransport
from drivers.cia402.motion import make_winch
from drivers.cia402.profile import Mode
from drivers.cia402.watch import CanopenMaster
from drivers.clock import LoopClock, precise_loop
from fidim_lab.errors import DeviceError
from sim_backends.drive.axis import DrumShaft, Profile
from sim_backends.drive.axis.machine import State
from sim_backends.drive.node import SimulatedDrive
from sim_backends.served_bus import ServedBus
from sim_backends.slcan_server import SlcanServerBus

HEARTBEAT_TIME = 0.25
"""s, 1016 of each drive"""
SYNC = 250.0
"""Hz"""
SPEED, ACCELERATION = 0.4, 2.0
PLACES = (1.8, 1.0)
"""m; a move takes two seconds"""
LATEST = 1.5
"""s after the beginning of a move"""
CYCLE = 0.005
"""s, the drive's own: it looks at its watchdog so often"""
BEFORE, TRAVEL = 0.05, 1e-3
"""s, m: a winch that went so far in so long was moving"""
_CHECKED = 8
"""commands at the end that may reach beyond the signal"""
AWAKE = 0.4
"""s that a woken master is watched"""
MODES = {Mode.PROFILE_POSITION: "profile position", Mode.CYCLIC_POSITION: "cyclic position"}


class WatchedShaft(DrumShaft):
    """Keeps its commands and when they came (s)."""

    def __init__(self) -> None:
        super().__init__()
        self.commands: list[tuple[float, Profile]] = []

    def follow(self, t: float, profile: Profile) -> None:
        self.commands.append((t, profile))
        super().follow(t, profile)

    def settled(self) -> float:
        """When it was told to stop, or came to rest, whichever is later (s)."""
        ends = [min(profile.end, after) for (_, profile), (after, _) in pairwise(self.commands)]
        told, last = self.commands[-1]
        return max(told, last.end, *ends[-_CHECKED:])


@dataclass(frozen=True)
class Round:
    """What one signal came to."""

    killed: bool
    mode: Mode
    early: bool = False
    """the drives had stopped before: the host's own heartbeat was late (a busy computer)"""
    stopped: bool = False
    """all four are in QUICK STOP ACTIVE"""
    rest: float = float("nan")
    """s from the signal until the last shaft stood"""
    under_way: float = 0.0
    """s after the signal at which the last heartbeat reached the drives"""
    moving: int = 0
    """winches that had moved within the last 50 ms before the signal"""
    moved_again: bool = False

    @property
    def allowed(self) -> float:
        """s"""
        return HEARTBEAT_TIME + CYCLE + SPEED / winch_config(1).quick_stop_deceleration

    @property
    def in_time(self) -> bool:
        return self.stopped and self.rest - self.under_way <= self.allowed and not self.moved_again


def kills(rounds: int, seed: int) -> str:
    """Signals at random moments, until there are enough that met a moving robot; the table."""
    rng, found = random.Random(seed), list[Round]()
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["benchmarks.bus.kills"])
    while sum(not one.early for one in found) < rounds:
        if len(found) > 4 * rounds + 10:
            raise SystemExit("this computer is too busy: the host itself is late most of the time")
        number = len(found)
        mode = list(MODES)[number // 2 % 2]
        found.append(_round(context, bool(number % 2), mode, rng.uniform(0.1, LATEST)))
        print(number, found[-1], flush=True)
    return _told(found)


def _round(context: "multiprocessing.context.ForkServerContext", kill: bool, mode: Mode, after: float) -> Round:
    shafts = [WatchedShaft() for _ in NODES]
    drives, witness = simulated_drives(list(shafts)), Witness()
    bus = SlcanServerBus("127.0.0.1", 0)
    ours, theirs = context.Pipe()
    with ServedBus(bus, [*drives, witness]) as served:
        victim = context.Process(target=_master, args=(bus.port, mode, theirs))
        victim.start()
        theirs.close()
        try:
            if not ours.poll(60.0):
                raise SystemExit("the master never moved")
            try:
                ours.recv()
            except EOFError:  # it ended on the way: its drives had stopped
                return Round(kill, mode, early=True)
            _pause(after)
            return _strike(Rig(served, drives, shafts, witness), victim.pid or 0, Round(kill, mode))
        finally:
            victim.kill()
            victim.join(10.0)
            ours.close()


@dataclass(frozen=True)
class Rig:
    """The simulated side of one round."""

    served: ServedBus
    drives: list[SimulatedDrive]
    shafts: list[WatchedShaft]
    witness: Witness

    def in_state(self, state: State) -> bool:
        with self.served.paused():
            return all(drive.state is state for drive in self.drives)

    def at_rest(self) -> bool:
        now = time.monotonic()
        return self.in_state(State.QUICK_STOP_ACTIVE) and self.settled() < now

    def settled(self) -> float:
        with self.served.paused():
            return max(shaft.settled() for shaft in self.shafts)

    def commands(self) -> list[int]:
        with self.served.paused():
            return [len(shaft.commands) for shaft in self.shafts]

    def moving(self, t: float) -> int:
        metres = 1.0 / winch_config(1).scale.counts_per_metre
        ways = [shaft.motion(t).position - shaft.motion(t - BEFORE).position for shaft in self.shafts]
        return sum(abs(way) * metres > TRAVEL for way in ways)


def _strike(rig: Rig, victim: int, planned: Round) -> Round:
    if not rig.in_state(State.OPERATION_ENABLED):
        return replace(planned, early=True)
    at = time.monotonic()
    os.kill(victim, signal.SIGKILL if planned.killed else signal.SIGSTOP)
    moving = rig.moving(at)
    deadline = at + planned.allowed + 1.0
    while time.monotonic() < deadline and not rig.at_rest():
        _pause(0.01)
    stopped, commands, again = rig.at_rest(), rig.commands(), False
    last = max(0.0, rig.witness.heartbeat - at)
    if not planned.killed:
        os.kill(victim, signal.SIGCONT)
        _pause(AWAKE)
        again = stopped and (rig.commands() != commands or not rig.at_rest())
    found = replace(planned, stopped=stopped, rest=rig.settled() - at, under_way=last)
    return replace(found, moving=moving, moved_again=again)


def _told(found: list[Round]) -> str:
    met = [one for one in found if not one.early]
    rows: list[tuple[str, str, str, str]] = []
    for killed, name in ((True, "SIGKILL"), (False, "SIGSTOP")):
        for mode, words in MODES.items():
            these = [one for one in met if one.killed is killed and one.mode is mode]
            if these:
                median, worst = np.quantile([one.rest for one in these], (0.5, 1.0))
                moving = sum(one.moving for one in these)
                count = f"{sum(one.in_time for one in these)} of {len(these)}"
                rows.append(
                    (
                        f"{name}, {words}",
                        f"{moving} of {len(NODES) * len(these)}",
                        f"{1e3 * median:.0f}, {1e3 * worst:.0f} ms",
                        count,
                    )
                )
    in_time = f"{sum(one.in_time for one in met)} of {len(met)}"
    rows.append(("all", f"{sum(one.moving for one in met)} of {len(NODES) * len(met)}", "", in_time))
    again = sum(one.moved_again for one in met)
    allowed = f"{1e3 * found[0].allowed:.0f} ms are allowed: heartbeat time (1016) {1e3 * HEARTBEAT_TIME:.0f} ms, "
    allowed += f"{1e3 * CYCLE:.0f} ms of the drive's own cycle, the ramp from {SPEED:g} m/s."
    woken = f" Woken masters that made something move again: {again} of {sum(not one.killed for one in met)}."
    late = (
        f" Further {len(found) - len(met)} rounds found the drives stopped already: the host had been late by itself."
    )
    return table(["", "winches moved", "at rest after: median, worst", "in time"], rows) + f"\n\n{allowed}{woken}{late}"


def _master(port: int, mode: Mode, parent: Connection) -> None:
    with asyncio.Runner(loop_factory=precise_loop) as runner:
        runner.run(_drive(port, mode, parent))


async def _drive(port: int, mode: Mode, parent: Connection) -> None:
    """Until somebody ends it."""
    clock = LoopClock()
    transport = PythonCanTransport("slcan", f"socket://127.0.0.1:{port}", sleep_after_open=0.02)
    master = CanopenMaster(transport, clock, sync_rate=SYNC)
    change = {"host_timeout": HEARTBEAT_TIME}
    winches = [make_winch(winch_config(node, mode, **change), master) for node in NODES]
    loop = asyncio.create_task(master.run())
    with suppress(DeviceError):  # the drives have stopped: nothing moves them any more
        await asyncio.gather(*(winch.configure() for winch in winches))
        await asyncio.gather(*(winch.enable() for winch in winches))
        while True:
            for place in PLACES:
                await asyncio.gather(*(winch.move_to(place, SPEED, ACCELERATION) for winch in winches))
                with suppress(OSError):
                    parent.send("moving")
                while not all((sample := winch.latest()) and sample.target_reached for winch in winches):
                    await clock.sleep(0.01)
    parent.close()
    await loop


def _pause(seconds: float) -> None:
    """Real seconds: another process is to be signalled."""
    threading.Event().wait(seconds)
