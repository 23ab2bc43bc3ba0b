"""Steps that take up slack: cables are wound by torque until they are taut, and the power is taken away again."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from procedures.steps.base import AfterPause, LastingStep, Phase, Step


@dataclass(frozen=True, kw_only=True)
class TakeUp(Step):
    """Give all winches power, then wind one cable after another by torque until it is taut. All hold afterwards.

    Values: m of cable wound, for each.
    """

    phase: ClassVar[Phase] = Phase.TAKING_UP
    after_pause: ClassVar[AfterPause] = AfterPause.NOT_INTERRUPTED

    tension: float
    """N"""
    speed: float
    """m/s"""
    way: float
    """m that one cable may be wound"""
    cables: int

    @property
    def text(self) -> str:
        """The step in words."""
        return (
            f"take up slack, one cable after another: {self.tension:g} N, at most {self.way:g} m at {self.speed:g} m/s"
        )

    @property
    def details(self) -> Mapping[str, Any]:
        """A journal must know that winches are about to move."""
        return {"tension": self.tension, "speed": self.speed, "way": self.way}

    @property
    def seconds(self) -> float:
        """Estimate."""
        return self.cables * (2.0 + 0.5 * self.way / self.speed)


@dataclass(frozen=True, kw_only=True)
class TakePower(LastingStep):
    """Take the power from all winches, and see by their encoders that brakes, or a jig, keep the cables."""

    phase: ClassVar[Phase] = Phase.TAKING_UP
    after_pause: ClassVar[AfterPause] = AfterPause.NOT_INTERRUPTED
    says: ClassVar[str] = "switch off the power; the brakes hold"

    still: float
    """m by which an encoder may move"""
