"""Steps that need the person at the robot."""

from dataclasses import dataclass
from typing import ClassVar

from drivers.ports import Prompt
from procedures.steps.base import AfterPause, LastingStep, Phase, Result, Step

SPREAD = 0.15
"""part by which the mean time of a run's answers is off the estimate: 0.89 to 1.10 of it over five dry runs"""


@dataclass(frozen=True, kw_only=True)
class Ask(Step):
    """Ask whoever stands at the robot, and wait for the answer."""

    phase: ClassVar[Phase] = Phase.HANDLING

    prompt: Prompt
    estimate: float
    """s"""

    @property
    def text(self) -> str:
        """The step in words."""
        return f"ask: {self.prompt.text}"

    @property
    def place(self) -> tuple[object, ...]:
        """Also what for."""
        return (type(self), self.window, self.prompt.kind)

    @property
    def seconds(self) -> float:
        """Estimate."""
        return self.estimate

    @property
    def seconds_between(self) -> tuple[float, float]:
        """As the mean of a run's answers may be."""
        return (1 - SPREAD) * self.estimate, (1 + SPREAD) * self.estimate

    @property
    def expected(self) -> Result:
        """The first choice."""
        return Result(answer=self.prompt.choices[0])


@dataclass(frozen=True, kw_only=True)
class AwaitHandsOff(LastingStep):
    """Wait until the marker moves by itself and every tension has margin. FAIL after the time-out.

    A hand that goes on moving the platform cannot be told from free motion here; identification finds it afterwards.
    """

    phase: ClassVar[Phase] = Phase.HANDLING
    after_pause: ClassVar[AfterPause] = AfterPause.SAME_ATTEMPT

    moving: float
    """m, least peak to peak of the marker's fastest coordinate"""
    limits: tuple[float, float]
    """N"""
    timeout: float
    """s"""

    @property
    def text(self) -> str:
        """The step in words."""
        low, high = self.limits
        return f"wait until the platform moves freely, with tensions between {low:g} and {high:g} N"
