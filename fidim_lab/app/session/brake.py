"""`fidim brake`: release the holding brake of one winch by hand, for mounting and homing, and apply it again."""

from dataclasses import dataclass
from pathlib import Path

from drivers.cia402.bring_up import refuse_other_master
from drivers.cia402.motion import Cia402Winch
from drivers.cia402.watch import set_brake
from drivers.clock import LoopClock
from fidim_lab.app import compose
from fidim_lab.app.compose.real import listening_time, make_master, open_bus
from fidim_lab.app.compose.winches import winch_configs
from fidim_lab.app.formats.answer_file import write_answer
from fidim_lab.app.service.lock import holder, in_use
from fidim_lab.app.service.place import place_of
from fidim_lab.app.terminal import console
from fidim_lab.data.rigs.rig import RigFile
from fidim_lab.data.rigs.rig_file import read_rig
from fidim_lab.errors import SetupError

FORMAT = "fidim-brake/1"
QUESTION = "A load on this cable will fall. Is the load secured, and is nobody under it?"


@dataclass(frozen=True)
class BrakeOptions:
    """As on the command line."""

    rig: Path
    winch: str
    release: bool
    yes: bool
    json_file: Path | None = None


def brake_command(options: BrakeOptions) -> int:
    """Do it; returns 0.

    Raises SetupError while a service has the rig or without such a winch, RefusedError for a no, and DeviceError.
    """
    file = read_rig(options.rig)
    if (other := holder(place_of(file, embedded=False))) is not None:
        raise SetupError(in_use(other))
    names = [entry.name for entry in file.winches]
    if options.winch not in names:
        raise SetupError(f"{options.rig}: no winch is named {options.winch!r}; there are {', '.join(names)}.")
    if options.release and not options.yes:
        console.confirm(QUESTION, "The brake was not changed; nothing was sent to the drive.")
    compose.run_loop(_set(file, names.index(options.winch), applied=not options.release), real_time=True)
    done = "released" if options.release else "applied"
    console.out.print(f"{options.winch}: brake {done}", markup=False)
    write_answer(options.json_file, FORMAT, {"winch": options.winch, "brake": done})
    return 0


async def _set(file: RigFile, index: int, *, applied: bool) -> None:
    clock = LoopClock()
    transport = open_bus(file)
    try:
        nodes = [entry.node_id for entry in file.winches]
        await refuse_other_master(transport, clock, file.bus.host_id, listening_time(file), nodes)
        winch = Cia402Winch(winch_configs(file)[index], make_master(file, transport, clock))
        await set_brake(winch.link, winch.config.brake_output, winch.config.device, applied=applied)
    finally:
        transport.close()
