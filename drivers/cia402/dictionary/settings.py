"""Objects that are compared with and written to a drive before it may have power, as a table. Pure."""

from collections.abc import Iterable
from dataclasses import dataclass

from drivers.cia402.dictionary.config import WinchConfig
from drivers.cia402.profile.words import Mode
from fidim_lab.errors import SetupError

_ALL_BITS = 0xFFFFFFFF
STOPS = ("1016:1", "1029:1", "6007:0", "605A:0", "605D:0", "605E:0", "6065:0", "6066:0", "6085:0")
"""objects by which a drive stops"""
_PROFILE_402 = 402
_SYNC_ID = 0x80
LIFE_TIME_FACTOR = 3
"""periods of the host's guarding without which a drive stops: as many as its heartbeat may miss"""
_SYNC_BITS = 0x400007FF  # the identifier, and bit 30: the drive produces SYNC


@dataclass(frozen=True)
class Setting:
    """One object that must hold `wanted`; `mask` says which of its bits count, `write` whether we put it there."""

    index: int
    sub: int
    wanted: int
    meaning: str
    write: bool = True
    mask: int = _ALL_BITS

    @property
    def object(self) -> str:
        """For messages and tables."""
        return f"{self.index:04X}:{self.sub:X}"

    @property
    def words(self) -> str:
        """What is wanted, for messages and tables."""
        return str(self.wanted) if self.mask == _ALL_BITS else f"0x{self.wanted:X} in the bits 0x{self.mask:X}"

    def told(self, value: int) -> str:
        """A value that was read back, for messages and tables."""
        return str(value) if self.mask == _ALL_BITS else f"0x{value:X}"

    def holds(self, found: int) -> bool:
        """Whether a value that was read back is the wanted one."""
        return (found & self.mask) == (self.wanted & self.mask)

    def check(self, found: int) -> "SettingCheck":
        """The line of the report for a value that was read back."""
        return SettingCheck(self.object, self.meaning, self.words, self.told(found), ok=self.holds(found))


@dataclass(frozen=True)
class SettingCheck:
    """One line of the bring-up report: what was wanted, what the drive says."""

    object: str
    meaning: str
    wanted: str
    found: str
    ok: bool

    def __str__(self) -> str:
        return f"{self.object} {self.meaning}: {self.found} found, {self.wanted} wanted"


def identity(config: WinchConfig, eds_identity: tuple[int, int], *, keeps_mode: bool = False) -> tuple[Setting, ...]:
    """Who must answer at this node: compared, never written.

    `eds_identity` is vendor and product of the EDS file, 0 meaning any; keeps_mode: its mode cannot be chosen (6060).
    """
    vendor = eds_identity[0] if config.vendor_id is None else config.vendor_id
    product = eds_identity[1] if config.product_code is None else config.product_code
    wanted = [
        Setting(0x1000, 0, _PROFILE_402, "device profile", write=False, mask=0xFFFF),
        Setting(0x1005, 0, _SYNC_ID, "SYNC identifier", write=False, mask=_SYNC_BITS),
    ]
    for sub, value, meaning in ((1, vendor, "vendor"), (2, product, "product code")):
        if value:
            wanted.append(Setting(0x1018, sub, value, meaning, write=False))
    if config.serial_number is not None:
        wanted.append(Setting(0x1018, 4, config.serial_number, "serial number", write=False))
    bit = 1 << (config.mode - 1)
    meaning = f"{config.mode.name.lower().replace('_', ' ')} mode supported"
    wanted.append(Setting(0x6502, 0, bit, meaning, write=False, mask=bit))
    if keeps_mode:
        wanted.append(Setting(0x6061, 0, config.mode, "mode of operation (6060 is read only)", write=False))
    own = config.family.rated_current
    if own is None:
        wanted.append(Setting(0x6075, 0, round(config.rated_current * 1000), "rated current, mA", write=False))
    else:
        digits = round(config.rated_current / own.ampere)
        wanted.append(Setting(own.index, own.sub, digits, "rated current, vendor object", write=False))
    if config.rated_torque is not None:
        wanted.append(Setting(0x6076, 0, round(config.rated_torque * 1000), "rated torque, mN m", write=False))
    return _as_family_has_it(config, wanted)


def limits(config: WinchConfig, host_id: int, *, guarded: bool = False) -> tuple[Setting, ...]:
    """Heartbeats, stop reactions and limits: written, read back, and a mismatch refused.

    guarded: the host is watched by life guarding in place of its heartbeat (`Abilities.guarded`).
    """
    scale, stop = config.scale, config.stop
    low, high = sorted(scale.count(length) for length in config.length_limits)
    per_mille = round(1000 * config.current_limit / config.rated_current)
    acceleration = config.drive_acceleration(config.max_acceleration)
    wanted = (
        *(_life_guarding(config) if guarded else _heartbeats(config, host_id)),
        Setting(0x1029, 1, stop.communication_error, "behaviour on communication error"),
        Setting(0x6007, 0, stop.connection_lost, "reaction to a lost connection"),
        Setting(0x605A, 0, stop.quick_stop, "quick stop option"),
        Setting(0x605D, 0, stop.halt, "halt option"),
        Setting(0x605E, 0, stop.fault, "fault reaction option"),
        Setting(0x607D, 1, low, "lowest position, counts"),
        Setting(0x607D, 2, high, "highest position, counts"),
        Setting(0x6065, 0, scale.magnitude(config.following_error), "following error window, counts"),
        Setting(0x6066, 0, _milliseconds(config.following_error_time), "following error time, ms"),
        Setting(0x6072, 0, per_mille, "highest torque, per mille of rated"),
        Setting(0x6073, 0, per_mille, "highest current, per mille of rated"),
        Setting(0x607F, 0, config.drive_speed(config.max_speed), "highest profile velocity"),
        Setting(0x6083, 0, acceleration, "profile acceleration"),
        Setting(0x6084, 0, acceleration, "profile deceleration"),
        Setting(0x6085, 0, config.drive_acceleration(config.quick_stop_deceleration), "quick stop deceleration"),
    )
    return _as_family_has_it(config, (*wanted, *_current_limit(config)))


def _heartbeats(config: WinchConfig, host_id: int) -> tuple[Setting, ...]:
    return (
        Setting(0x1017, 0, _milliseconds(config.heartbeat), "heartbeat of the drive, ms"),
        Setting(0x1016, 1, host_id << 16 | _milliseconds(config.host_timeout), "watch of the host's heartbeat"),
    )


def _life_guarding(config: WinchConfig) -> tuple[Setting, ...]:
    """CiA 301 forbids both at once: a drive that sends heartbeats is not guarded."""
    guard_time = max(1, int(1000.0 * config.host_timeout / LIFE_TIME_FACTOR + 1e-9))
    return (
        Setting(0x1017, 0, 0, "heartbeat of the drive, ms: none beside node guarding"),
        Setting(0x100C, 0, guard_time, "guard time, ms"),
        Setting(0x100D, 0, LIFE_TIME_FACTOR, "life time factor"),
    )


def stop_settings(config: WinchConfig, host_id: int) -> dict[str, int]:
    """What a drive is told that its stops rest on, by object: a proof by trial holds for these values alone."""
    told = {s.object: s.wanted for s in limits(config, host_id) if s.object in STOPS}
    return {"6060:0": int(config.mode), **told}


def _current_limit(config: WinchConfig) -> tuple[Setting, ...]:
    """Where the family keeps it in an object of its own."""
    own = config.family.current_limit
    if own is None:
        return ()
    return (Setting(own.index, own.sub, round(config.current_limit / own.ampere), "highest current, vendor object"),)


def _as_family_has_it(config: WinchConfig, wanted: Iterable[Setting]) -> tuple[Setting, ...]:
    """Without the objects that the drive family lacks."""
    return tuple(setting for setting in wanted if setting.object not in config.family.absent)


def interpolation(config: WinchConfig, period: float) -> tuple[Setting, ...]:
    """The interpolation period (60C2), which must be the SYNC period (s), where the mode needs one.

    Raises SetupError for a period that 60C2 cannot say: mantissa up to 255, power of ten.
    """
    if config.mode is not Mode.CYCLIC_POSITION:
        return ()
    for exponent in (-3, -4, -5, -6):
        mantissa = period * 10.0**-exponent
        if 1.0 <= round(mantissa) <= 255 and abs(mantissa - round(mantissa)) < 1e-6:
            meaning = "interpolation period"
            return Setting(0x60C2, 1, round(mantissa), meaning), Setting(0x60C2, 2, exponent, f"{meaning}, power of 10")
    raise SetupError(
        f"bus, sync_rate: a period of {period:g} s cannot be set in drives in cyclic position mode.",
        hint="Use a rate such as 100, 125, 200, 250, 400 or 500 Hz.",
    )


def _milliseconds(seconds: float) -> int:
    return max(1, round(seconds * 1000))
