"""`fidim power-off`: take the power from a rig's drives, as after a run whose host has gone, and acknowledge faults."""

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from drivers.cia402.bring_up import refuse_other_master
from drivers.cia402.motion import Cia402Winch
from drivers.cia402.watch import acknowledge_fault, read_state, take_power
from drivers.clock import LoopClock
from drivers.ports import Clock, DriveState
from fidim_lab.app import compose
from fidim_lab.app.compose.real import listening_time, make_master, open_bus
from fidim_lab.app.compose.winches import winch_configs
from fidim_lab.app.formats.answer_file import write_answer
from fidim_lab.app.service.lock import holder, in_use
from fidim_lab.app.service.place import place_of
from fidim_lab.app.terminal import console
from fidim_lab.data.rigs.rig import RigFile
from fidim_lab.data.rigs.rig_file import read_rig
from fidim_lab.errors import DeviceError, HardwareError, SetupError

FORMAT = "fidim-power-off/1"
QUESTION = "Without power only brakes and stands hold the platform. Is the load secured?"
WATCHED = 1.0
"""s after the last drive has lost its power"""
STILL = 3e-4
"""m of cable in that time: three counts of a coarse encoder (2000 a turn, no gear, drum 30 mm); a brake that slips by
0.3 mm/s is told, 5 mm in 17 s"""
ENDED_FIRST = (
    "A service holds the load with the drives' power. End the service first (fidim shutdown), then repeat this command."
)


@dataclass(frozen=True)
class PowerOffOptions:
    """As on the command line."""

    rig: Path
    yes: bool
    acknowledged_by: str | None
    json_file: Path | None = None


def power_off_command(options: PowerOffOptions) -> int:
    """Switch off drive by drive; returns 3 where one keeps its power or its fault, turns without it, or is silent.

    Raises SetupError while a service has the rig; BusError where the bus cannot be reached, and where another master is
    heard: that one holds the load.
    """
    file = read_rig(options.rig)
    if (other := holder(place_of(file, embedded=False))) is not None:
        raise SetupError(in_use(other), hint=ENDED_FIRST)
    if not options.yes:
        console.confirm(QUESTION, "Nothing was sent to the drives.")
    drives: list[dict[str, object]] = []
    code = compose.run_loop(_power_off(file, options.acknowledged_by, drives), real_time=True)
    write_answer(options.json_file, FORMAT, {"exit_code": code, "drives": drives})
    return code


async def _power_off(file: RigFile, acknowledged_by: str | None, told: list[dict[str, object]]) -> int:
    clock = LoopClock()
    transport = open_bus(file)
    failed = False
    watched: list[Cia402Winch] = []
    try:
        nodes = [entry.node_id for entry in file.winches]
        await refuse_other_master(transport, clock, file.bus.host_id, listening_time(file), nodes)
        master = make_master(file, transport, clock)
        for winch in [Cia402Winch(config, master) for config in winch_configs(file)]:
            link, device = winch.link, winch.config.device
            try:
                before = await read_state(link)
                after = await take_power(link, clock, device)
                if after is DriveState.FAULT and acknowledged_by is not None:
                    after = await acknowledge_fault(link, clock, device, acknowledged_by)
            except DeviceError as error:
                failed = True
                told.append({"drive": device, "error": str(error)})
                console.err.print(str(error), markup=False)
                continue
            failed |= after is DriveState.FAULT
            watched.append(winch)
            told.append({"drive": device, "before": str(before), "after": str(after)})
            hint = "; find the cause, then repeat with --acknowledge NAME" if after is DriveState.FAULT else ""
            console.out.print(f"{device}: {before} → {after}{hint}", markup=False)
        failed |= await _turns(watched, clock, told)
    finally:
        transport.close()
    return HardwareError.exit_code if failed else 0


async def _turns(winches: Sequence[Cia402Winch], clock: Clock, told: list[dict[str, object]]) -> bool:
    """Whether a drum turns that has no power any more, by its encoder: its brake does not hold."""
    before = await asyncio.gather(*map(_length, winches))
    await clock.sleep(WATCHED)
    after = await asyncio.gather(*map(_length, winches))
    turns = False
    for winch, was, now in zip(winches, before, after, strict=True):
        if was is None or now is None or abs(now - was) > STILL:
            turns = True
            way = "its encoder does not answer" if was is None or now is None else f"{1e3 * (now - was):+.1f} mm"
            says = f"{winch.config.device} is not seen to stand without power ({way} in {WATCHED:g} s): keep away."
            told.append({"drive": winch.config.device, "error": says})
            console.err.print(says, markup=False)
    return turns


async def _length(winch: Cia402Winch) -> float | None:
    try:
        return await winch.ask_length()
    except DeviceError:
        return None
