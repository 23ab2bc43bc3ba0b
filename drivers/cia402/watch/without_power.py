"""Switching off drives that a host has left behind, and acknowledging faults: without a control loop.

A host that ends leaves its drives in quick stop, holding the load (6007, 605A). Nothing may take the power away but a
person who knows that brakes or stands hold the load; after that a bring-up begins anew.
"""

from drivers.cia402.profile.machine import Command, state_of
from drivers.cia402.profile.words import controlword
from drivers.cia402.watch.node import NodeLink
from drivers.ports import Clock, DriveState
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


async def _reach(link: NodeLink, clock: Clock, device: str, wanted: tuple[DriveState, ...]) -> DriveState:
    state = await read_state(link)
    deadline = clock.now() + _TIMEOUT
    while state not in wanted:
        if clock.now() >= deadline:
            raise DeviceError(device, f"is still in “{state}” after {_TIMEOUT:g} s.", hint="Use the hardware switch.")
        await clock.sleep(_LOOK)
        state = await read_state(link)
    return state
