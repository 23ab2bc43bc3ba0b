"""Steps with a release device: it takes hold of the displaced platform, and lets it go."""

from dataclasses import dataclass
from typing import ClassVar

from procedures.steps.base import AfterPause, Phase, Step


@dataclass(frozen=True, kw_only=True)
class TakeHold(Step):
    """The release takes hold, confirmed by its state."""

    phase: ClassVar[Phase] = Phase.HANDLING
    after_pause: ClassVar[AfterPause] = AfterPause.SAME_ATTEMPT
    says: ClassVar[str] = "the release takes hold"
    takes: ClassVar[float] = 0.2


@dataclass(frozen=True, kw_only=True)
class LetGo(Step):
    """The release lets go, confirmed by its state; no move begins before."""

    phase: ClassVar[Phase] = Phase.HANDLING
    after_pause: ClassVar[AfterPause] = AfterPause.NOT_INTERRUPTED
    says: ClassVar[str] = "the release lets go"
    takes: ClassVar[float] = 0.2


@dataclass(frozen=True, kw_only=True)
class AwaitHeld(Step):
    """Wait until the release holds the platform still, displaced within limits. Values: the marker's place, m."""

    phase: ClassVar[Phase] = Phase.HANDLING
    after_pause: ClassVar[AfterPause] = AfterPause.SAME_ATTEMPT

    equilibrium: tuple[float, ...]
    """m, the marker at rest"""
    least: float
    """m, displacement in x, y together; less tells too little"""
    displacement: tuple[float, float]
    """m, largest of the marker's x, y from rest"""
    still: float
    """m, peak to peak"""
    over: float
    """s"""
    timeout: float
    """s"""

    @property
    def text(self) -> str:
        """The step in words."""
        return (
            f"wait until the release holds the platform {self.least * 1e3:g} mm or more away from rest, within "
            f"{self.still * 1e3:g} mm for {self.over:g} s"
        )

    @property
    def seconds(self) -> float:
        """Estimate."""
        return 2.0 * self.over
