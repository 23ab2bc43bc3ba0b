"""One move and one sample of a winch, between cable (m, A) and drive (counts, per mille). Pure."""

from drivers.cia402.dictionary.config import WinchConfig
from drivers.cia402.dictionary.settings import Setting
from drivers.cia402.profile.scale import LengthScale
from drivers.cia402.profile.words import TARGET_REACHED
from drivers.cia402.watch.health import Health
from drivers.cia402.wire.pdo import DriveValues
from drivers.ports import DriveState, WinchSample
from fidim_lab.errors import RefusedError


def refuse_beyond_limits(config: WinchConfig, length: float, speed: float, acceleration: float) -> None:
    """Raises RefusedError naming all that this winch may not do in a move (m, m/s, m/s²); NaN never passes."""
    low, high = config.length_limits
    mistakes: list[str] = []
    if not low <= length <= high:
        mistakes.append(f"a length of {length:.4f} m, allowed is {low:g} to {high:g} m")
    if not 0.0 < speed <= config.max_speed:
        mistakes.append(f"a speed of {speed:g} m/s, allowed is up to {config.max_speed:g} m/s")
    if not 0.0 < acceleration <= config.max_acceleration:
        mistakes.append(f"an acceleration of {acceleration:g} m/s², allowed is up to {config.max_acceleration:g} m/s²")
    if mistakes:
        raise RefusedError(f"{config.device} refuses the move: {'; '.join(mistakes)}.")


def profile(config: WinchConfig, speed: float, acceleration: float) -> tuple[Setting, ...]:
    """Speed (m/s) and acceleration (m/s²) of one move."""
    ramp = config.drive_acceleration(acceleration)
    return (
        Setting(0x6081, 0, config.drive_speed(speed), "profile velocity"),
        Setting(0x6083, 0, ramp, "profile acceleration"),
        Setting(0x6084, 0, ramp, "profile deceleration"),
    )


def make_sample(
    values: DriveValues, config: WinchConfig, scale: LengthScale, state: DriveState, health: Health
) -> WinchSample:
    """What a drive tells by its PDOs in one bus cycle, and of its health, as the port says it.

    A positive motor current of the drive turns towards rising counts; ours is positive where the winch pulls.
    """
    lag = health.following_error
    return WinchSample(
        t=values.t,
        state=state,
        length=scale.length(values.position),
        velocity=config.cable_speed(values.velocity),
        current=config.ampere_per_mille * (-config.direction * values.current) + config.current_offset,
        target_reached=bool(values.statusword & TARGET_REACHED),
        following_error=None if lag is None else scale.velocity(lag),
        temperature=health.temperature,
    )
