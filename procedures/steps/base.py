"""Common to all steps: text, estimated time, what guards may expect meanwhile, and possible results."""

from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, ClassVar

from procedures.outcomes import Measurement, Outcome

Lengths = tuple[float, ...]


class Phase(StrEnum):
    """What the robot may be doing, by which guards know what to expect."""

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
    """What resuming does with a step that was interrupted."""

    NOT_INTERRUPTED = "not interrupted"
    """short, or half of it would be worse than all: a pause waits for its end"""
    SAME_STEP = "same step"
    """is carried out once more"""
    SAME_ATTEMPT = "same attempt"
    """the free motion is spoilt: displaced, released and recorded again, never spliced"""


@dataclass(frozen=True)
class Result:
    """What came of a step."""

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

    window: str = ""

    @property
    def text(self) -> str:
        """What is done, for a person."""
        return type(self).__name__

    @property
    def place(self) -> tuple[object, ...]:
        """Where in a procedure it stands: the same for repetitions of a step, different for any two others."""
        return (type(self), self.window)

    @property
    def details(self) -> Mapping[str, Any]:
        """What a journal must know of it before it begins, as JSON has it."""
        return {}

    @property
    def seconds(self) -> float:
        """How long it should take."""
        return 0.0

    @property
    def expected(self) -> Result:
        """What a reader without hardware takes for its result."""
        return Result()


Steps = Generator[Step, Result, None]
Procedure = Callable[[], Steps]
"""Makes a fresh generator: the same procedure is read several times (listing, limit check, run)."""
