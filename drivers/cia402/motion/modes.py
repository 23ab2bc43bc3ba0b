"""Modes for commissioning: turning a drum at a speed, taking up slack by torque, setting the encoder's zero.

`switch_mode` for all of them: at standstill only, and done when the drive displays the mode (6061); one that the drive
does not take is an error. Every function leaves the winch in the mode of its config.
"""

import math

from drivers.cia402.motion.moves import refuse_beyond_limits
from drivers.cia402.motion.winch import STANDSTILL, Cia402Winch
from drivers.cia402.profile.machine import Command, state_of
from drivers.cia402.profile.words import Mode, controlword, mode_name
from drivers.cia402.wire.sdo import SdoRefusedError
from drivers.ports import DriveState
from fidim_lab.errors import DeviceError, RefusedError

HOME_HERE = 37
"""homing method: the present position is home; older drives call it 35"""
LONGEST_JOG = 10.0
"""s"""
SPEED_LIMIT = 0x607F
"""by which a drive in torque mode keeps a slack cable's drum from running away"""
RUNS_AWAY = 1.5
"""times the speed that was allowed: a drum that goes faster is stopped"""
GIVES_WAY = 3e-3
"""m of cable that may be paid out while torque takes over from position, as `guards.motion` allows by default: a load
beyond the torque pays out at the speed limit, 3 mm in 0.06 s at 0.05 m/s"""
TAUT = 0.3
"""s for which a pulled drum must stand for its cable to count as taut: a slack one goes on at once"""
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
        digits = max(1, round(config.drive_velocity(speed)))
        signed = int(math.copysign(digits, speed * config.direction))
        await sdo.write_verified(0x60FF, 0, signed)
        winch.drive.send(order, controlword(Command.ENABLE_OPERATION))
        await winch.clock.sleep(seconds)
        await sdo.write(0x60FF, 0, 0)
    finally:
        await winch.hold()
    await _back(winch)


async def pull_taut(winch: Cia402Winch, current: float, speed: float, way: float) -> float:
    """Wind an enabled winch with `current` (A) at most, at `speed` (m/s), until its cable is taut; m of cable wound.

    In profile torque mode: for slack before homing, and for a pretension. It holds its place afterwards, in the mode of
    its config. A cable that carries as much already is left as it is: less torque than its load would pay it out.
    Raises RefusedError beyond the winch's current or speed, or where the drive keeps its speed limit (607F) to itself;
    DeviceError where the drum runs away or the cable is paid out, `way` (m) is not enough (then it stands in quick
    stop), or as `switch_mode`.
    """
    config, sdo, device = winch.config, winch.link.sdo, winch.config.device
    if not 0.0 < current <= config.current_limit or not 0.0 < speed <= config.max_speed or not way > 0.0:
        raise RefusedError(
            f"{device} refuses to pull with {current:g} A at {speed:g} m/s over {way:g} m; allowed is up to "
            f"{config.current_limit:g} A and {config.max_speed:g} m/s."
        )
    if not (winch.link.able.can_write(SPEED_LIMIT) and winch.link.able.can_write(0x6071)):
        raise RefusedError(f"{device} has no speed limit in torque mode (607F): a slack cable's drum would run away.")
    _require_power(winch)
    sample = winch.latest()
    if sample is not None and sample.current >= current:
        return 0.0
    await switch_mode(winch, Mode.PROFILE_TORQUE)
    order, start = winch.drive.begin(), await winch.ask_length()
    try:
        await sdo.write_verified(SPEED_LIMIT, 0, config.drive_speed(speed))
        await sdo.write(0x6071, 0, -config.direction * config.torque_digits(current))
        winch.drive.send(order, controlword(Command.ENABLE_OPERATION))
        await _until_taut(winch, start, speed, way)
        await sdo.write(0x6071, 0, 0)
    finally:
        winch.quick_stop()
        await sdo.write_verified(SPEED_LIMIT, 0, config.drive_speed(config.max_speed))
    # It holds in quick stop meanwhile: without its torque, as in halt, the cable would go slack again.
    order = winch.drive.begin()
    await winch.drive.stand_still(order, config.drive_velocity(STANDSTILL * config.max_speed), _STILL_WITHIN)
    await winch.drive.choose(order, controlword(Command.QUICK_STOP), config.mode)
    await winch.enable()
    return start - await winch.ask_length()


async def _until_taut(winch: Cia402Winch, start: float, speed: float, way: float) -> None:
    """Look at the encoder until it stands. Raises DeviceError where it goes too fast or too far."""
    clock, device = winch.clock, winch.config.device
    slow = STANDSTILL * winch.config.max_speed
    since = clock.now()
    deadline = since + 2.0 * way / speed + TAUT + 1.0
    while clock.now() - since < TAUT:
        await clock.sleep(0.01)
        values = winch.drive.healthy()
        velocity = abs(winch.config.cable_speed(values.velocity))
        gone = start - await winch.ask_length()
        if gone < -GIVES_WAY:
            raise DeviceError(device, f"its cable is paid out ({-gone * 1e3:.0f} mm): its load exceeds the torque.")
        if velocity > RUNS_AWAY * speed:
            raise DeviceError(device, f"its drum runs away at {velocity:.3f} m/s; {speed:g} m/s was allowed.")
        if gone > way or clock.now() > deadline:
            raise DeviceError(device, f"the cable is not taut after {gone:.3f} m; {way:g} m was allowed.")
        if velocity > slow:
            since = clock.now()


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
