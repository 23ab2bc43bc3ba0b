"""Taking up slack by torque: the drive changes to profile torque mode at standstill, and back afterwards."""

from drivers.cia402.motion.winch import STANDSTILL, Cia402Winch
from drivers.cia402.profile.machine import Command, state_of
from drivers.cia402.profile.words import Mode, controlword, mode_name
from drivers.ports import DriveState
from fidim_lab.errors import DeviceError, RefusedError

TORQUE = 0x6071
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


async def _choose_torque_mode(winch: Cia402Winch) -> None:
    """At standstill. Raises DeviceError."""
    drive, link, device = winch.drive, winch.link, winch.config.device
    winch.free()
    if link.able.has(0x6502) and not await link.sdo.read(0x6502) >> (Mode.PROFILE_TORQUE - 1) & 1:
        raise DeviceError(device, f"does not have the mode {mode_name(Mode.PROFILE_TORQUE)} (6502).")
    order = drive.begin()
    await drive.stand_still(order, winch.config.drive_velocity(STANDSTILL * winch.config.max_speed), _STILL_WITHIN)
    drive.target = drive.healthy().position
    await drive.choose(order, controlword(Command.ENABLE_OPERATION, halt=True), Mode.PROFILE_TORQUE)


async def pull_taut(winch: Cia402Winch, current: float, speed: float, way: float) -> float:
    """Wind an enabled winch with `current` (A) at most, at `speed` (m/s), until its cable is taut; m of cable wound.

    In profile torque mode: for slack before homing, and for a pretension. It holds its place afterwards, in the mode of
    its config. A cable that carries as much already is left as it is: less torque than its load would pay it out.
    Raises RefusedError beyond the winch's current or speed, or where the drive keeps its speed limit (607F) to itself
    or takes its torque (6071) by RPDO alone;
    DeviceError where the drum runs away or the cable is paid out, `way` (m) is not enough (then it stands in quick
    stop), or where the drive does not have the mode (6502) or does not display it (6061) in time.
    """
    config, sdo, device = winch.config, winch.link.sdo, winch.config.device
    if not 0.0 < current <= config.current_limit or not 0.0 < speed <= config.max_speed or not way > 0.0:
        raise RefusedError(
            f"{device} refuses to pull with {current:g} A at {speed:g} m/s over {way:g} m; allowed is up to "
            f"{config.current_limit:g} A and {config.max_speed:g} m/s."
        )
    if not (winch.link.able.can_write(SPEED_LIMIT) and winch.link.able.can_write(TORQUE)):
        raise RefusedError(f"{device} has no speed limit in torque mode (607F): a slack cable's drum would run away.")
    if winch.link.able.keeps_mode:
        raise RefusedError(f"{device} cannot pull: its mode (6060) is read only, and torque is another.")
    if any(entry.mapping >> 16 == TORQUE for entry in winch.link.layout.rpdo.entries):
        raise RefusedError(f"{device} cannot pull: its fixed RPDO has the torque (6071) beside the controlword.")
    if state_of(winch.drive.healthy().statusword) is not DriveState.OPERATION_ENABLED:
        raise DeviceError(device, "has no power.", hint="Enable it first.")
    sample = winch.latest()
    if sample is not None and sample.current >= current:
        return 0.0
    await _choose_torque_mode(winch)
    order, start = winch.drive.begin(), await winch.ask_length()
    try:
        await sdo.write_verified(SPEED_LIMIT, 0, config.drive_speed(speed))
        await sdo.write(TORQUE, 0, -config.direction * config.torque_digits(current))
        winch.drive.send(order, controlword(Command.ENABLE_OPERATION))
        await _until_taut(winch, start, speed, way)
        await sdo.write(TORQUE, 0, 0)
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
