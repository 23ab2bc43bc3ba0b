"""`fidim simulators`: the devices of a rig file, simulated in real time in this process, until Ctrl-C.

Lines on standard input pull plugs: `bus`, `mocap`, `drive 2`, `fault 3`, `off 4`, `serial 1`. `drive 2 again` puts one
back.
"""

import asyncio
import contextlib
import os
import sys
import threading
from dataclasses import dataclass
from pathlib import Path

from fidim_lab.app import compose
from fidim_lab.app.terminal import console
from fidim_lab.data.design_file import read_plan_or_design
from fidim_lab.data.rigs.rig import RigFile
from fidim_lab.data.rigs.rig_file import read_rig
from fidim_lab.errors import BusError, FidimError, SetupError

LOOK = 0.2
"""s between two looks at the bus"""
END = ""
"""stands for the end of standard input; lines are never empty"""


@dataclass(frozen=True)
class SimulatorOptions:
    """As on the command line."""

    rig: Path
    seed: int
    hide: tuple[str, ...]
    plan: Path | None
    ports: str | None = None
    """BUS,MOCAP,HAND: rehearse the rig on these instead of what it names"""
    no_load: bool = False
    """drums turn freely, the platform stays where it is"""
    until_input_ends: bool = False
    """for a parent process, with which this one ends"""


def simulators_command(options: SimulatorOptions) -> int:
    """Serve until Ctrl-C, and return the exit code. Raises FidimError where the devices cannot be simulated."""
    file = read_rig(options.rig)
    if options.ports is not None:
        file = compose.rehearsal_file(file, _ports(options.ports))
    try:
        compose.run_loop(_serve(file, options), real_time=True)
    except KeyboardInterrupt:
        console.out.print("simulators ended", markup=False)
    return 0


async def _serve(file: RigFile, options: SimulatorOptions) -> None:
    plan = None if options.plan is None else read_plan_or_design(options.plan, file.robot.n)
    async with compose.simulated_devices(file, options.seed, options.hide, plan, loaded=not options.no_load) as devices:
        lengths = " ".join(f"{length:.3f}" for length in devices.start)
        _say(f"{len(devices.drives)} drives on {file.bus.name}, the robot rests at lengths {lengths} m")
        _say(f"motion capture: {file.motion_capture.kind}, {file.motion_capture.place}")
        if file.hand is not None:
            _say(f"hand: {file.hand.host}:{file.hand.port}")
        named = [entry.name for entry in (file.release, *file.gauges) if entry is not None]
        for number, name in enumerate(named, start=1):
            _say(f"serial {number}: {name}")
        serial = ", serial K" if named else ""
        _say(f"ready; Ctrl-C ends. Type a failure: bus, mocap, drive K{serial} (undo it with “again”), fault K, off K")
        lines = _standard_input(asyncio.get_running_loop())
        while devices.served.failure is None:
            try:
                async with asyncio.timeout(LOOK):
                    line = await lines.get()
            except TimeoutError:
                continue
            if line == END:
                if options.until_input_ends:
                    return
                continue
            try:
                _say(await devices.pull(line))
            except FidimError as error:
                _say(str(error))
        raise BusError(f"The simulated drives have lost their bus: {devices.served.failure}.")


def _ports(text: str) -> compose.Ports:
    parts = text.split(",", 3)
    numbers = parts[:3]
    if len(numbers) != 3 or not all(part.isdigit() and 0 < int(part) < 65536 for part in numbers):
        raise SetupError(f"--ports {text}: three ports are expected: bus, motion capture, hand.")
    bus, motion_capture, hand = map(int, numbers)
    return compose.Ports(bus, motion_capture, hand, serial="".join(parts[3:]))


def _say(text: str) -> None:
    """At once, also where the output is a pipe."""
    console.out.print(text, markup=False, highlight=False, soft_wrap=True)
    sys.stdout.flush()


def _standard_input(loop: asyncio.AbstractEventLoop) -> asyncio.Queue[str]:
    """Lines typed by a person or sent by a script, then `END`."""
    lines: asyncio.Queue[str] = asyncio.Queue()

    def read() -> None:
        # Not through sys.stdin: a thread that waits within its buffer's lock spoils the end of the interpreter.
        with contextlib.suppress(OSError, ValueError, RuntimeError):  # none, closed, or the loop has ended
            descriptor, rest = sys.stdin.fileno(), ""
            while data := os.read(descriptor, 4096):
                *whole, rest = (rest + data.decode(errors="replace")).split("\n")
                for line in filter(None, map(str.strip, whole)):
                    loop.call_soon_threadsafe(lines.put_nowait, line)
        with contextlib.suppress(RuntimeError):
            loop.call_soon_threadsafe(lines.put_nowait, END)

    threading.Thread(target=read, name="standard input", daemon=True).start()
    return lines
