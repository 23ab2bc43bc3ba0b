"""The rig file's values of one winch, checked once at the boundary."""

import math
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from drivers.cia402.dictionary.family import GENERIC_FAMILY, DriveFamily, counts_per_digit, ramp_speed
from drivers.cia402.dictionary.requirements import TrialPassed
from drivers.cia402.profile.scale import COUNT_MAX, COUNT_MIN, LengthScale
from drivers.cia402.profile.signals import Signal
from drivers.cia402.profile.words import Mode
from fidim_lab.errors import SetupError

GENERIC_EDS = Path(__file__).parent / "eds" / "generic_cia402.eds"
"""Our own small object dictionary; velocity in counts/s, acceleration in counts/s²."""

MOVING_MODES = (Mode.PROFILE_POSITION, Mode.CYCLIC_POSITION)


@dataclass(frozen=True)
class StopReactions:
    """What the drive does without us: values of its option codes, written and read back before power is allowed.

    A coasting winch (0) drops its load, so none of these may be 0.
    """

    quick_stop: int = 6
    """605A: 6 stops on the quick-stop ramp and holds with power on; 2 takes the power away after the ramp"""
    halt: int = 1
    """605D: 1 stops on the profile's ramp and holds"""
    fault: int = 2
    """605E: 2 stops on the quick-stop ramp"""
    connection_lost: int = 3
    """6007, when the host's heartbeat stops: 3 is quick stop"""
    communication_error: int = 1
    """1029:1: 1 stays operational, so that what the drive does stays visible; 0 goes to pre-operational"""

    @property
    def holds_in_quick_stop(self) -> bool:
        """Whether the drive keeps holding its load in quick stop (605A is 5 to 8)."""
        return 5 <= self.quick_stop <= 8

    def mistakes(self) -> list[str]:
        """What is not allowed, in sentences."""
        allowed = {
            "quick_stop": (self.quick_stop, (1, 2, 3, 4, 5, 6, 7, 8)),
            "halt": (self.halt, (1, 2, 3, 4)),
            "fault": (self.fault, (1, 2, 3, 4)),
            "connection_lost": (self.connection_lost, (3,)),
            "communication_error": (self.communication_error, (0, 1)),
        }
        return [
            f"stop.{key}: {found} found, allowed is one of {', '.join(map(str, values))}"
            for key, (found, values) in allowed.items()
            if found not in values
        ]


@dataclass(frozen=True)
class TemperatureObject:
    """Where a drive family keeps its temperature: a vendor object, and °C for one digit of it."""

    index: int
    sub: int = 0
    scale: float = 1.0


class Load(StrEnum):
    """What a drive tells of its load, in each bus cycle."""

    VENDOR = "vendor"
    """the family's own object"""
    CURRENT = "current"
    """6078, per mille of 6075"""
    TORQUE = "torque"
    """6077, per mille of 6076, for drives without 6078"""


@dataclass(frozen=True)
class StoredZero:
    """What an earlier session has left of an encoder's zero."""

    serial_number: int
    """1018:4 of the drive that was zeroed; 0: it has none"""
    multi_turn: bool
    last_count: int | None
    """where the encoder was seen last; None: never since"""
    tolerance: int
    """counts by which it may have been turned since"""


@dataclass(frozen=True)
class WinchConfig:
    """One CANopen winch: node, drum, limits; SI units.

    Every check names the key. Raises SetupError, all mistakes at once.
    """

    name: str
    node_id: int
    """1 … 126; 127 is the host's"""
    counts_per_turn: float
    """encoder counts for one turn of the drum, gear included"""
    drum_radius: float
    """m, to the middle of the cable"""
    rated_current: float
    """A; compared with object 6075"""
    current_limit: float
    """A"""
    max_speed: float
    """m/s of cable"""
    max_acceleration: float
    """m/s²"""
    length_limits: tuple[float, float]
    """m, shortest and longest cable; also written as the drive's own position limits"""
    direction: int = 1
    """+1 where rising counts pay cable out, −1 otherwise"""
    reversed: bool = False
    """whether the drive's polarity (607E) is set; `direction` is as seen with that"""
    home_count: int = 0
    home_length: float = 0.0
    """m, cable length at `home_count`"""
    quick_stop_deceleration: float = 2.0
    """m/s². A stop while the platform goes up takes 0.22 of each tension for each m/s² (the paper's robot, 0.05 to
    0.2 m/s): at 5 all cables hang slack, at 2 they keep half; from 0.1 m/s it takes 2.5 mm"""
    following_error: float = 0.02
    """m; the drive faults beyond it"""
    following_error_time: float = 0.05
    """s"""
    heartbeat: float = 0.1
    """s between the drive's heartbeats"""
    host_timeout: float = 0.25
    """s without the host's heartbeat until the drive stops by itself; at least three of the host's periods"""
    sdo_timeout: float = 0.5
    """s"""
    step_timeout: float = 2.0
    """s for one step of the drive machine; brakes take their time"""
    stop: StopReactions = StopReactions()
    eds: Path = GENERIC_EDS
    vendor_id: int | None = None
    """1018:1; None takes the EDS file's, 0 is any"""
    product_code: int | None = None
    """1018:2"""
    serial_number: int | None = None
    """1018:4; name it to notice two winches that changed places"""
    rated_torque: float | None = None
    """N m; compared with object 6076, None: not"""
    sample_age: float | None = None
    """s after which a sample is not believed any more; None: ten SYNC periods, at least 0.05 s"""
    temperature: TemperatureObject | None = None
    """where the drive family keeps its temperature; None: not asked for"""
    sto: Signal | None = None
    """the input (60FD) that is active while safe torque off is; None: none is told"""
    brake_output: Signal | None = None
    """the output (60FE) that is active while the brake is applied by hand; None: the drive keeps it to itself"""
    mode: Mode = Mode.PROFILE_POSITION
    """in which the winch moves: profile position, or cyclic position (`CyclicWinch`)"""
    zero: StoredZero | None = None
    """what an earlier session has left of home_count; None: the rig file says it, and nothing is checked"""
    family: DriveFamily = GENERIC_FAMILY
    """units, vendor objects, and what it lacks"""
    motor_counts: float | None = None
    """encoder counts for one turn of the motor, for families that speak of rpm; None: no gear"""
    load: Load = Load.CURRENT
    torque_constant: float | None = None
    """N m/A, which turns a torque that the drive tells into the current that it stands for (load: torque)"""
    current_offset: float = 0.0
    """A added to what the drive says, from a calibration against known tensions"""
    proofs: tuple[TrialPassed, ...] = ()
    """trials of its stops that the drive has passed (`fidim commission`)"""
    on_trial: bool = False
    """such a trial is under way: what is to be proven is not yet asked for"""

    def __post_init__(self) -> None:
        mistakes = [*self._range_mistakes(), *self.stop.mistakes()]
        if not mistakes:
            mistakes = self._limit_mistakes()
        if mistakes:
            raise SetupError(f"winch {self.name!r}: " + "; ".join(mistakes) + ".")

    @property
    def scale(self) -> LengthScale:
        """Counts to lengths and back, from the home given here."""
        return LengthScale.of_drum(
            self.counts_per_turn, self.drum_radius, self.direction, self.home_count, self.home_length
        )

    @property
    def device(self) -> str:
        """For messages: winch and node."""
        return f"{self.name} (node {self.node_id})"

    def drive_speed(self, metres: float) -> int:
        """A speed (m/s) without direction as the drive is told it (6081, 607F), at least 1."""
        return max(1, round(self._digits(metres, self.family.speed)))

    def drive_acceleration(self, metres: float) -> int:
        """An acceleration (m/s²) without direction as the drive is told it (6083 to 6085), at least 1."""
        if (speed := self.ramp_speed) is not None:
            return max(1, round(1e3 * speed / (abs(metres) * self.scale.counts_per_metre)))
        return max(1, round(self._digits(metres, self.family.acceleration or self.family.speed)))

    def drive_velocity(self, metres: float) -> float:
        """A speed (m/s) without direction as the drive tells it (606C), and is told it in velocity mode (60FF)."""
        return self._digits(metres, self.family.velocity_unit)

    def cable_speed(self, digits: float) -> float:
        """m/s of cable, positive pays out, of a velocity as the drive tells it (606C)."""
        return self.scale.velocity(digits * self.counts_per_digit(self.family.velocity_unit))

    def counts_per_digit(self, unit: str) -> float:
        """counts/s (counts/s²) for one digit of a quantity in a unit of the drive family."""
        return counts_per_digit(unit, self._motor_counts)

    @property
    def ramp_speed(self) -> float | None:
        """counts/s of the family whose ramps are times to a speed (`family.ramp_speed`); None of all others."""
        return ramp_speed(self.family.acceleration, self._motor_counts)

    @property
    def _motor_counts(self) -> float:
        return self.counts_per_turn if self.motor_counts is None else self.motor_counts

    def _digits(self, metres: float, unit: str) -> float:
        return abs(metres) * self.scale.counts_per_metre / self.counts_per_digit(unit)

    @property
    def ampere_per_mille(self) -> float:
        """A for one digit (per mille of rated, unless a vendor object) of what the drive tells of its load."""
        if self.load is Load.VENDOR and self.family.load_object is not None:
            return self.family.load_object.ampere
        if self.load is not Load.TORQUE or self.rated_torque is None or self.torque_constant is None:
            return self.rated_current / 1000.0
        return self.rated_torque / self.torque_constant / 1000.0

    def torque_digits(self, current: float) -> int:
        """What a drive is told (6071, per mille of rated) for a current (A) without direction, as it tells its load."""
        torque = self.load is Load.TORQUE
        return round((current - self.current_offset) / (self.ampere_per_mille if torque else self.rated_current / 1e3))

    def _range_mistakes(self) -> list[str]:
        positive = {
            key: getattr(self, key)
            for key in (
                *("counts_per_turn", "drum_radius", "rated_current", "current_limit", "max_speed", "max_acceleration"),
                *("quick_stop_deceleration", "following_error", "following_error_time", "heartbeat", "host_timeout"),
                *("sdo_timeout", "step_timeout"),
            )
        }
        found = [
            f"{key}: {value!r} found, must be a number above 0"
            for key, value in positive.items()
            if not (math.isfinite(value) and value > 0.0)
        ]
        if not self.name.strip():
            found.append("name: empty, every winch needs one")
        if not 1 <= self.node_id <= 126:
            found.append(f"node_id: {self.node_id} found, allowed is 1 to 126 (127 is the host's)")
        if self.load is Load.TORQUE and not (self.rated_torque and self.torque_constant):
            found.append(
                "rated_torque, torque_constant: are missing; the drive reports torque as a fraction of the rated torque"
            )
        if self.mode not in MOVING_MODES:
            found.append(f"mode: {self.mode!r} found, allowed are profile position and cyclic position")
        if self.direction not in (-1, 1):
            found.append(f"direction: {self.direction} found, allowed is 1 or -1")
        if not COUNT_MIN <= self.home_count <= COUNT_MAX:
            found.append(f"home_count: {self.home_count} found, an encoder count has 32 bits")
        if not math.isfinite(self.home_length):
            found.append(f"home_length: {self.home_length!r} found, must be a number")
        return found

    def _limit_mistakes(self) -> list[str]:
        found: list[str] = []
        low, high = self.length_limits
        if not 0.0 <= low < high < math.inf:
            found.append(f"length_limits: [{low}, {high}] found, the first must be at least 0 and below the second")
        else:
            counts = [self.scale.unwrapped_count(length) for length in (low, high)]
            if min(counts) < COUNT_MIN or max(counts) > COUNT_MAX:
                found.append(
                    f"length_limits: at counts {min(counts)} to {max(counts)} they lie beyond the encoder's 32 bits, "
                    "where the drive could not guard them; set the drive's encoder to another zero"
                )
        if self.current_limit > 10.0 * self.rated_current:
            found.append(
                f"current_limit: {self.current_limit} A found, more than ten times the rated {self.rated_current} A"
            )
        for key in ("heartbeat", "host_timeout", "following_error_time"):
            if not 1e-3 <= getattr(self, key) <= 65.0:
                found.append(f"{key}: {getattr(self, key)} s found, allowed is 0.001 to 65 s")
        return found
