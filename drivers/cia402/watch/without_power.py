"""Switching off drives that a host has left behind, acknowledging faults, brakes by hand: without a control loop.

A host that ends leaves its drives in quick stop, holding the load (6007, 605A). Nothing may take the power away but a
person who knows that brakes or stands hold the load; after that a bring-up begins anew.

In operation a brake is the drive's own matter: it opens it once it has power, and closes it before it takes it away.
By hand it is released for mounting, for a cable that must be pulled out, for homing.
"""

from drivers.cia402.profile.machine import Command, state_of
from drivers.cia402.profile.signals import OUTPUTS
from drivers.cia402.profile.words import controlword
from drivers.cia402.watch.node import NodeLink
from drivers.ports import Clock, DriveState
from fidim_lab.data.rigs.rig_winch_tables import Signal
from fidim_lab.errors import DeviceError, RefusedError

_TIMEOUT = 3.0
"""s; brakes take their time"""
_LOOK = 0.05
_WITHOUT_POWER = (DriveState.SWITCH_ON_DISABLED, DriveState.READY, DriveState.FAULT, DriveState.NOT_READY)


async def read_state(link: NodeLink) -> DriveState:
    """The drive's state as it says itself. Raises DeviceError."""
    return state_of(await link.sdo.read(0x6041))


async def take_power(link: NodeLink, clock: Clock, device: str) -> DriveState:
    """Disable voltage; returns the state without power. Raises DeviceError where the power stays."""
    link.send_controlword(controlword(Command.DISABLE_VOLTAGE), 0)
    return await _reach(link, clock, device, _WITHOUT_POWER)


async def acknowledge_fault(link: NodeLink, clock: Clock, device: str, by: str) -> DriveState:
    """Reset a fault that the person `by` has looked at; never gives power. Raises RefusedError, DeviceError."""
    if not by.strip():
        raise RefusedError(f"{device}: a fault is reset only when somebody acknowledges it by name.")
    for command in (Command.DISABLE_VOLTAGE, Command.FAULT_RESET, Command.DISABLE_VOLTAGE):  # a rising edge of bit 7
        link.send_controlword(controlword(command), 0)
        await clock.sleep(_LOOK)
    return await _reach(link, clock, device, (DriveState.SWITCH_ON_DISABLED, DriveState.READY))


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


async def _reach(link: NodeLink, clock: Clock, device: str, wanted: tuple[DriveState, ...]) -> DriveState:
    state = await read_state(link)
    deadline = clock.now() + _TIMEOUT
    while state not in wanted:
        if clock.now() >= deadline:
            why = f": it refuses the controlword ({link.refusal})" if link.refusal else ""
            raise DeviceError(
                device, f"is still in “{state}” after {_TIMEOUT:g} s{why}.", hint="Use the hardware switch."
            )
        await clock.sleep(_LOOK)
        state = await read_state(link)
    return state
