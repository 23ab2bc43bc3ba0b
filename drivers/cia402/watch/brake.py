"""Holding brakes by hand: release to turn a drum without power, and apply again.

In operation a brake is the drive's own matter: it opens it once it has power, and closes it before it takes it away.
This is for mounting, for a cable that must be pulled out, for homing: only without power, with the load secured.
"""

from drivers.cia402.profile.signals import OUTPUTS
from drivers.cia402.watch.node import NodeLink
from drivers.cia402.watch.without_power import read_state
from drivers.ports import DriveState
from fidim_lab.data.rigs.rig_winch_tables import Signal
from fidim_lab.errors import DeviceError

_WITHOUT_POWER = (DriveState.NOT_READY, DriveState.SWITCH_ON_DISABLED, DriveState.READY, DriveState.FAULT)


async def set_brake(link: NodeLink, brake: Signal | None, device: str, *, applied: bool) -> None:
    """Write mask and level, and read them back. A brake that is to be applied is so in every state of the drive.

    Raises DeviceError where the drive has no such output, has power (released only without), or does not keep it.
    """
    if brake is None or not (link.able.can_write(OUTPUTS, 1) and link.able.can_write(OUTPUTS, 2)):
        raise DeviceError(
            device,
            "has no brake that can be released by hand (60FE).",
            hint="Name its output in the rig file (brake_output), or use the drive's own tool.",
        )
    state = await read_state(link)
    if not applied and state not in _WITHOUT_POWER:
        raise DeviceError(
            device, f"has power ({state}): its brake is its own matter.", hint="fidim power-off RIG first."
        )
    level = brake.put(await link.sdo.read(OUTPUTS, 1), applied)
    await link.sdo.write_verified(OUTPUTS, 1, level)
    await link.sdo.write_verified(OUTPUTS, 2, await link.sdo.read(OUTPUTS, 2) | 1 << brake.bit)
