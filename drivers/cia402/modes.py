"""Modes for commissioning: turning a drum at a speed, and making the present place the encoder's zero.

`switch_mode` for all of them: at standstill only, and done when the drive displays the mode (6061); one that the drive
does not take is an error. Every function leaves the winch in the mode of its config.
"""

import math

from drivers.cia402.machine import Command, state_of
from drivers.cia402.moves import refuse_beyond_limits
from drivers.cia402.sdo import SdoRefusedError
from drivers.cia402.winch import STANDSTILL, Cia402Winch
from drivers.cia402.words import Mode, controlword, mode_name
from drivers.ports import DriveState
from fidim_lab.errors import DeviceError, RefusedError

HOME_HERE = 37
"""homing method: the present position is home; older drives call it 35"""
LONGEST_JOG = 10.0
"""s"""
_STILL_WITHIN = 0.5
"""s; a winch that still moves is not waited for"""
_NEW, _ATTAINED, _ERROR = 1 << 4, 1 << 12, 1 << 13


async def switch_mode(winch: Cia402Winch, mode: Mode) -> None:
    """Choose a mode at standstill.

    Raises DeviceError where the drive moves, does not have the mode (6502), or does not display it (6061) in time.
    """
    drive, link, device = winch.drive, winch.link, winch.config.device
    winch.free()
    if link.able.has(0x6502) and not await link.sdo.read(0x6502) >> (mode - 1) & 1:
        raise DeviceError(device, f"does not have the mode {mode_name(mode)} (6502).")
    order = drive.begin()
    await drive.stand_still(order, winch.config.drive_velocity(STANDSTILL * winch.config.max_speed), _STILL_WITHIN)
    drive.target = drive.healthy().position
    await drive.choose(order, controlword(Command.ENABLE_OPERATION, halt=True) if _has_power(winch) else 0, mode)


async def jog(winch: Cia402Winch, speed: float, seconds: float) -> None:
    """Turn an enabled winch at `speed` (m/s of cable, positive pays out) for some seconds, in profile velocity mode.

    Stops whatever happens, and at the drive's position limits. Raises RefusedError beyond the winch's speed, for longer
    than LONGEST_JOG, or out of the length limits where the drive has none; DeviceError as `switch_mode`.
    """
    config, sdo = winch.config, winch.link.sdo
    sample = winch.latest()
    if sample is not None and not winch.link.able.can_write(0x607D, 1):
        refuse_beyond_limits(config, sample.length + speed * seconds, abs(speed), config.max_acceleration)
    if not 0.0 < abs(speed) <= config.max_speed or not 0.0 < seconds <= LONGEST_JOG:
        raise RefusedError(
            f"{config.device} refuses to jog at {speed:g} m/s for {seconds:g} s; allowed is up to "
            f"{config.max_speed:g} m/s and {LONGEST_JOG:g} s."
        )
    _require_power(winch)
    await switch_mode(winch, Mode.PROFILE_VELOCITY)
    order = winch.drive.begin()
    try:
        signed = int(math.copysign(config.drive_speed(speed), speed * config.direction))
        await sdo.write_verified(0x60FF, 0, signed)
        winch.drive.send(order, controlword(Command.ENABLE_OPERATION))
        await winch.clock.sleep(seconds)
        await sdo.write(0x60FF, 0, 0)
    finally:
        await winch.hold()
    await _back(winch)


async def home_here(winch: Cia402Winch, offset: int = 0, method: int = HOME_HERE) -> int:
    """Make the present position the count `offset` (607C), in homing mode; returns the position (counts) then.

    Lengths go by the config's home_count: a winch whose counts have changed must be configured anew. Raises DeviceError
    as `switch_mode`, and where the drive refuses the method or says that homing failed.
    """
    sdo, drive, device = winch.link.sdo, winch.drive, winch.config.device
    _require_power(winch)
    try:
        await sdo.write_verified(0x6098, 0, method)
        await sdo.write_verified(0x607C, 0, offset)
    except SdoRefusedError as error:
        raise DeviceError(device, f"does not home by method {method}: {error.reason}.") from error
    await switch_mode(winch, Mode.HOMING)
    order = drive.begin()
    try:
        drive.send(order, controlword(Command.ENABLE_OPERATION))
        drive.send(order, controlword(Command.ENABLE_OPERATION) | _NEW)
        values = await drive.word(order, lambda word: bool(word & (_ATTAINED | _ERROR)), "homing attained or failed")
        if values.statusword & _ERROR:
            raise DeviceError(device, f"homing by method {method} failed (statusword 0x{values.statusword:04X}).")
        position = drive.believed().position
    finally:
        await _back(winch)
    return position


async def _back(winch: Cia402Winch) -> None:
    await switch_mode(winch, winch.config.mode)
    await winch.enable()


def _has_power(winch: Cia402Winch) -> bool:
    return state_of(winch.drive.healthy().statusword) is DriveState.OPERATION_ENABLED


def _require_power(winch: Cia402Winch) -> None:
    if not _has_power(winch):
        raise DeviceError(winch.config.device, "has no power.", hint="Enable it first.")
