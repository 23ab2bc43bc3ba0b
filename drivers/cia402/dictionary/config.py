"""What the driver of one winch goes by: the settings of its rig file, checked once, and what belongs to its drive."""

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any, Self

from pydantic import ModelWrapValidatorHandler, ValidationError, model_validator

from drivers.cia402.dictionary.family import GENERIC_FAMILY, DriveFamily, counts_per_digit, ramp_speed
from drivers.cia402.dictionary.requirements import TrialPassed
from drivers.cia402.profile.scale import COUNT_MAX, COUNT_MIN, LengthScale
from drivers.cia402.profile.words import Mode
from fidim_lab.data.files.input_file import place_words
from fidim_lab.data.files.mistakes import mistakes
from fidim_lab.data.files.toml_file import Positive
from fidim_lab.data.rigs.rig_winch_tables import WinchSettings
from fidim_lab.errors import SetupError

GENERIC_EDS = Path(__file__).parent / "eds" / "generic_cia402.eds"
"""Our own small object dictionary; velocity in counts/s, acceleration in counts/s²."""

MOVING_MODES = (Mode.PROFILE_POSITION, Mode.CYCLIC_POSITION)


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


class WinchConfig(WinchSettings):
    """One CANopen winch: what its rig file says of it, and what follows from the files beside that; SI units.

    Raises SetupError, naming the keys of all mistakes at once.
    """

    counts_per_turn: Positive
    """encoder counts for one turn of the drum, gear included"""
    step_timeout: Positive = 2.0
    """s for one step of the drive machine; brakes take their time"""
    eds: Path = GENERIC_EDS
    sample_age: float | None = None
    """s after which a sample is not believed any more; None: ten SYNC periods, at least 0.05 s"""
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

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.load is Load.TORQUE and not (self.rated_torque and self.torque_constant):
            raise ValueError(
                "rated_torque, torque_constant: are missing; the drive reports torque as a fraction of the rated torque"
            )
        if self.mode not in MOVING_MODES:
            raise ValueError(f"mode: {self.mode!r} found, allowed are profile position and cyclic position")
        counts = [self.scale.unwrapped_count(length) for length in self.length_limits]
        if min(counts) < COUNT_MIN or max(counts) > COUNT_MAX:
            raise ValueError(
                f"length_limits: at counts {min(counts)} to {max(counts)} they lie beyond the encoder's 32 bits, "
                "where the drive could not guard them; set the drive's encoder to another zero"
            )
        return self

    @model_validator(mode="wrap")
    @classmethod
    def _told(cls, values: Any, check: ModelWrapValidatorHandler[Self]) -> Self:
        """Any mistake, also one of the validators before, as a SetupError."""
        try:
            return check(values)
        except ValidationError as error:
            found = mistakes(error.errors(include_url=False), values)
            told = [": ".join(filter(None, (place_words(place), sentence))) for place, sentence, _ in found]
            raise SetupError(f"winch {values.get('name')!r}: {'; '.join(told)}.") from None

    def changed(self, **values: Any) -> Self:
        """With other values, checked as a new one."""
        return type(self)(**(vars(self) | values))

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
