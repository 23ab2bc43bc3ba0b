"""A rehearsal of any rig file: its devices in a child process, met through real sockets by the drivers that a run uses.

`rehearsal_file` is the rig as it is rehearsed; `embedded_devices` starts `fidim simulators` for it and ends it after.
"""

import asyncio
import contextlib
import os
import socket
import sys
import tempfile
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from fidim_lab.data.plan_file import write_plan
from fidim_lab.data.records import Plan
from fidim_lab.data.rigs.rig import MocapEntry, RigFile, WinchEntry
from fidim_lab.data.rigs.rig_guard_tables import GuardsTable
from fidim_lab.data.rigs.rig_tables import BusTable, HandTable, MocapKind
from fidim_lab.errors import HardwareError
from procedures.settings import Settings

HOST = "127.0.0.1"
COMMAND = "from fidim_lab.app.cli import main; main()"
"""`fidim`, wherever it is installed"""
READY = "ready"
"""how the line begins with which `fidim simulators` says that it serves"""
READY_WITHIN = 60.0
END_WITHIN = 10.0
"""s"""
SYNC_RATE = 100.0
"""Hz at most"""
PATIENCE = 3.0
"""s that everything may be late: simulators, service and screens share one computer, which may be busy"""
HAND_ANSWERS, HAND_STEADIES = 4.5, 2.1
"""s that a simulated hand needs to displace and let go, and to steady: means of 52 and 61 prompts of four dry runs"""
STOP_LATE = 0.2
"""s that a stop may take besides its reaction and its ramp, for the same reason"""
GAP, COMPLETE = 0.5, 0.9
"""s without a marker position, and part of the samples that must be there, for the same reason"""


@dataclass(frozen=True)
class Ports:
    """Where a rehearsal's devices are on this computer; 0 while that does not matter."""

    bus: int = 0
    motion_capture: int = 0
    hand: int = 0
    serial: str = ""
    """folder of the pseudo terminals of serial devices"""

    @property
    def text(self) -> str:
        """As `fidim simulators --ports` takes it."""
        numbers = f"{self.bus},{self.motion_capture},{self.hand}"
        return f"{numbers},{self.serial}" if self.serial else numbers


def free_ports() -> Ports:
    """Three that nobody has at the moment."""
    with contextlib.ExitStack() as stack:
        kinds = (socket.SOCK_STREAM, socket.SOCK_DGRAM, socket.SOCK_STREAM)
        taken = [stack.enter_context(socket.socket(socket.AF_INET, kind)) for kind in kinds]
        for one in taken:
            one.bind((HOST, 0))
        return Ports(*(one.getsockname()[1] for one in taken))


def rehearsal_file(file: RigFile, ports: Ports) -> RigFile:
    """The same robot, winches, limits and guards, with bus, cameras and hand on this computer.

    Times within which something must answer are at least `PATIENCE`; every other threshold is the rig's own. Whatever
    the rig's bus and cameras are, they become SLCAN over TCP and Vicon datagrams.
    """
    return replace(
        file,
        bus=_bus(file.bus, ports.bus),
        winches=tuple(_patient_winch(winch) for winch in file.winches),
        motion_capture=_motion_capture(file, ports.motion_capture),
        guards=_patient_guards(file.guards),
        hand=HandTable.model_construct(host=HOST, port=ports.hand),  # unchecked: port 0 while it does not matter
        keeps_homes=False,
        release=None if file.release is None else replace(file.release, **_patient_line(ports, 0)),
        gauges=tuple(replace(gauge, **_patient_line(ports, k)) for k, gauge in enumerate(file.gauges, start=1)),
    )


def _patient_line(ports: Ports, number: int) -> dict[str, Any]:
    """A serial device under a name of this rehearsal, number 0 being the release."""
    port = str(Path(ports.serial) / f"serial{number}")
    return {"port": port, **({"age": PATIENCE} if number else {"timeout": PATIENCE, "watchdog": PATIENCE})}


def hand_settings(settings: Settings) -> Settings:
    """With the times that the simulated hand takes."""
    return replace(settings, prompt_estimate=HAND_ANSWERS, steady_estimate=HAND_STEADIES)


def patient_settings(settings: Settings) -> Settings:
    """For a rehearsal: what shares a busy computer comes late, and is not held against it. Limits stay as they are."""
    return replace(
        hand_settings(settings),
        motion=replace(settings.motion, together=max(settings.motion.together, PATIENCE)),
        record=replace(settings.record, longest_gap=max(settings.record.longest_gap, GAP), complete=COMPLETE),
        commission=replace(settings.commission, late=max(settings.commission.late, STOP_LATE)),
        hold=replace(settings.hold, timeout=max(settings.hold.timeout, 2.0 * PATIENCE)),
    )


@asynccontextmanager
async def embedded_devices(
    file: RigFile, plan: Plan, seed: int, hide: tuple[str, ...], *, loaded: bool = True
) -> AsyncGenerator[RigFile]:
    """Serve a rig file's devices from a child process until the context ends; yields the rig file to open.

    The robot rests at the plan's first lengths; where it is not `loaded`, its cables carry nothing and it stays there.
    Raises HardwareError with what the child said where it cannot serve. The child ends with this process, however that
    ends: it is told by its standard input.
    """
    with tempfile.TemporaryDirectory(prefix="fidim-embedded-") as folder:
        ports = replace(free_ports(), serial=folder)
        start = Path(folder) / "start.toml"
        write_plan(start, plan)
        effects = [part for effect in hide for part in ("--hide", effect)]
        effects += [] if loaded else ["--no-load"]
        arguments = [str(file.path), "--plan", str(start), "--seed", str(seed), *effects, "--ports", ports.text]
        child = await asyncio.create_subprocess_exec(
            *(sys.executable, "-c", COMMAND, "simulators", *arguments, "--until-input-ends"),
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.STDOUT,
            start_new_session=True,
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        )
        try:
            await _until_ready(child)
            yield rehearsal_file(file, ports)
        finally:
            await asyncio.shield(_end(child))


async def _until_ready(child: asyncio.subprocess.Process) -> None:
    said: list[str] = []
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(READY_WITHIN):
            while child.stdout is not None and (line := await child.stdout.readline()):
                said.append(line.decode(errors="replace").strip())
                if said[-1].startswith(READY):
                    return
    text = " ".join(said).removeprefix("fidim: ") or f"it said nothing within {READY_WITHIN:g} s"
    raise HardwareError(f"The simulated devices did not start: {text}")


async def _end(child: asyncio.subprocess.Process) -> None:
    if child.stdin is not None:
        child.stdin.close()
    try:
        async with asyncio.timeout(END_WITHIN):
            await child.communicate()
    except TimeoutError:
        with contextlib.suppress(ProcessLookupError):
            child.kill()
        await child.wait()


def _bus(bus: BusTable, port: int) -> BusTable:
    channel, options = f"socket://{HOST}:{port}", {"sleep_after_open": 0.1}
    rate = min(bus.sync_rate, SYNC_RATE)
    return bus.model_copy(update={"interface": "slcan", "channel": channel, "sync_rate": rate, "options": options})


def _motion_capture(file: RigFile, port: int) -> MocapEntry:
    names = tuple(f"marker{k}" for k in range(1, len(file.robot.markers) + 1))
    return replace(
        file.motion_capture,
        kind=MocapKind.VICON_UDP,
        host=HOST,
        port=port,
        transport="udp",
        markers=names,
        subject=None,
        sender=None,
    )


def _patient_winch(winch: WinchEntry) -> WinchEntry:
    times = {
        "heartbeat": max(winch.heartbeat, PATIENCE / 3.0),
        "host_timeout": max(winch.host_timeout, PATIENCE),
        "sdo_timeout": max(winch.sdo_timeout, PATIENCE),
    }
    return winch.model_copy(update={"home": None, **times})


def _patient_guards(guards: GuardsTable) -> GuardsTable:
    stale, loop, marker = guards.stale_winch, guards.host_loop, guards.marker
    return guards.model_copy(
        update={
            "stale_winch": stale.model_copy(update={"age": max(stale.age, PATIENCE)}),
            "host_loop": loop.model_copy(update={"late": max(loop.late, PATIENCE)}),
            "marker": marker.model_copy(update={"lasting": max(marker.lasting, PATIENCE)}),
        }
    )
