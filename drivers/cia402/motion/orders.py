"""How a move, a hold and a quick stop begin: whether the drive's state allows it, and the number of the command."""

from drivers.cia402.motion.drive import Drive
from drivers.cia402.profile.machine import Command, state_of
from drivers.cia402.profile.words import Mode, controlword, mode_name
from drivers.cia402.wire.pdo import DriveValues
from drivers.ports import DriveState
from fidim_lab.errors import DeviceError


def begin_move(drive: Drive, device: str) -> int:
    """The order of a move. Raises DeviceError where there is a fault or no power."""
    order = drive.begin()
    state = state_of(drive.healthy().statusword)
    if state is not DriveState.OPERATION_ENABLED:
        raise DeviceError(device, f"cannot move: {state}.", hint="Enable it first.")
    return order


def begin_hold(drive: Drive, device: str) -> tuple[int, DriveValues]:
    """The order of a hold, and what the drive told last: it is enabled, or already in its quick stop.

    Raises DeviceError where it has no power, where it would give way (in torque mode a halt takes the torque away), and
    where its state is unknown: then a quick stop has been sent.
    """
    order = drive.begin()
    try:
        values = drive.believed()
    except DeviceError:
        quick_stop(drive)
        raise
    state = state_of(values.statusword)
    if state not in (DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE):
        raise DeviceError(device, f"cannot hold, it has no power: {state}.")
    if state is DriveState.OPERATION_ENABLED and values.mode == Mode.PROFILE_TORQUE:
        raise DeviceError(device, f"does not hold its place in {mode_name(values.mode)}.")
    return order, values


def quick_stop(drive: Drive, *, again: bool = False) -> None:
    """Stop on the quick-stop ramp: one frame, never waits. again: by SDO, too, for the other way may be the fault."""
    drive.send(drive.begin(), controlword(Command.QUICK_STOP), both_ways=again)
