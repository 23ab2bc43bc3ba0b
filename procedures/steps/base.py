"""Common to all steps: text, estimated time, what guards may expect meanwhile, and possible results."""

from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, ClassVar

from procedures.outcomes import Measurement, Outcome

Lengths = tuple[float, ...]


class Phase(StrEnum):
    """What guards must expect of the robot."""

    PREPARING = "preparing"
    """no power yet: drives are not expected to be enabled"""
    WITHOUT_POWER = "without power"
    """somebody may be at the robot, and no drive may have power"""
    TRYING = "trying"
    """without load, one drive after another is made to stop by itself: faults and silence are what is asked for"""
    TAKING_UP = "taking up"
    """one winch after another winds its slack by torque: such a drive leaves OPERATION ENABLED for a moment"""
    MOVING = "moving"
    RESTING = "resting"
    HANDLING = "handling"
    """somebody touches the platform"""
    RECORDING = "recording"

    @property
    def powered(self) -> bool:
        """Whether a run in this phase may have given power."""
        return self not in (Phase.PREPARING, Phase.WITHOUT_POWER)


class AfterPause(StrEnum):
    """How a run is resumed at a step that was interrupted."""

    NOT_INTERRUPTED = "not interrupted"
    """short, or half of it would be worse than all: a pause waits for its end"""
    SAME_STEP = "same step"
    """is carried out once more"""
    SAME_ATTEMPT = "same attempt"
    """the free motion is spoilt: displaced, released and recorded again, never spliced"""


@dataclass(frozen=True)
class Result:
    """The result of a step."""

    outcome: Outcome = Outcome.PASS
    reason: str = ""
    """a sentence; empty when there is nothing to say"""
    measurements: tuple[Measurement, ...] = ()
    answer: str = ""
    """of a prompt"""
    values: tuple[float, ...] = ()
    """what the step read: encoder lengths, tensions, or the marker's position at rest"""
    readings: Mapping[str, tuple[float, ...]] = field(default_factory=dict[str, tuple[float, ...]])
    """what it was made of, by name, for the journal: motor currents, for a calibration afterwards"""


@dataclass(frozen=True, kw_only=True)
class Step:
    """One step. `window` is the planned window it belongs to, empty where it belongs to none."""

    phase: ClassVar[Phase] = Phase.RESTING
    after_pause: ClassVar[AfterPause] = AfterPause.SAME_STEP
    says: ClassVar[str] = ""
    """its `text`, where that does not depend on its values"""
    takes: ClassVar[float] = 0.0
    """its `seconds`, likewise"""

    window: str = ""

    @property
    def text(self) -> str:
        """The step in words, for a person."""
        return self.says or type(self).__name__

    @property
    def place(self) -> tuple[object, ...]:
        """The place of a step in a procedure: equal for repetitions of a step, different for any two others."""
        return (type(self), self.window)

    @property
    def details(self) -> Mapping[str, Any]:
        """The data that the journal needs before the step begins, as JSON."""
        return {}

    @property
    def seconds(self) -> float:
        """How long it should take."""
        return self.takes

    @property
    def seconds_between(self) -> tuple[float, float]:
        """The least and the most that it takes in a run in which nothing is recorded twice, s."""
        return self.seconds, self.seconds

    @property
    def expected(self) -> Result:
        """The result that a reader without hardware assumes."""
        return Result()


@dataclass(frozen=True, kw_only=True)
class LastingStep(Step):
    """A step that looks at something for a time."""

    over: float
    """s"""

    @property
    def seconds(self) -> float:
        """As long as it looks."""
        return self.over


Steps = Generator[Step, Result, None]
Procedure = Callable[[], Steps]
"""Makes a fresh generator: the same procedure is read several times (listing, limit check, run)."""
