"""Steps of homing: everything is measured without power, and nothing moves."""

from dataclasses import dataclass
from typing import ClassVar

from procedures.steps.base import AfterPause, LastingStep, Lengths, Phase, Step
from procedures.steps.person import Ask
from procedures.steps.window import GiveUp


@dataclass(frozen=True, kw_only=True)
class Configure(Step):
    """Configure all winches without power, and wait until they report. Values: lengths by the zeros so far, m."""

    phase: ClassVar[Phase] = Phase.PREPARING
    after_pause: ClassVar[AfterPause] = AfterPause.NOT_INTERRUPTED
    says: ClassVar[str] = "configure the winches, without power"
    takes: ClassVar[float] = 2.0

    timeout: float = 5.0
    """s for the first samples"""


@dataclass(frozen=True, kw_only=True)
class AskWithoutPower(Ask):
    """As `Ask`, before there is any power."""

    phase: ClassVar[Phase] = Phase.WITHOUT_POWER


@dataclass(frozen=True, kw_only=True)
class GiveUpWithoutPower(GiveUp):
    """The result at a place where no drive had power."""

    phase: ClassVar[Phase] = Phase.PREPARING

    @property
    def text(self) -> str:
        """What is said."""
        return f"{self.outcome}{f': {self.reason}' if self.reason else ''}"


@dataclass(frozen=True, kw_only=True)
class MeasurePose(LastingStep):
    """The platform's pose by three or more markers, at rest. Values: the cable lengths that belong to it, m."""

    phase: ClassVar[Phase] = Phase.PREPARING

    still: float
    """m, peak to peak of each marker coordinate"""
    misfit: float
    """m, root mean square of a marker coordinate against the robot file's markers"""

    @property
    def text(self) -> str:
        """The step in words."""
        return f"measure the pose by its markers for {self.over:g} s, fitting within {self.misfit * 1e3:g} mm"


@dataclass(frozen=True, kw_only=True)
class SetLengths(LastingStep):
    """Take the encoders' present counts for these cable lengths. Values: by how much each length changes, m."""

    phase: ClassVar[Phase] = Phase.PREPARING
    after_pause: ClassVar[AfterPause] = AfterPause.NOT_INTERRUPTED

    lengths: Lengths
    """m"""
    still: float
    """m within which the encoders must stand meanwhile"""

    @property
    def text(self) -> str:
        """The step in words."""
        where = " ".join(f"{length:.4f}" for length in self.lengths) or "(measured)"
        return f"set the encoders' present counts to lengths {where} m"
