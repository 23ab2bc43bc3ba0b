"""The step that proves one stop of one winch: without load, by its own encoder."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from drivers.ports import Trial
from procedures.steps.base import AfterPause, Phase, Step


@dataclass(frozen=True, kw_only=True)
class ProveStop(Step):
    """Configure and enable one winch, let it move, withhold or command something, and see it stop and stay.

    PASS with the time (s) and the way (m) that it took, as `values`; SKIPPED where the drive cannot be tried so; FAIL
    says what it did instead, and with the answer RUNS_ON that nothing but taking its power has stopped it.
    """

    phase: ClassVar[Phase] = Phase.TRYING
    after_pause: ClassVar[AfterPause] = AfterPause.NOT_INTERRUPTED

    winch: int
    """from 0"""
    trial: Trial
    speed: float
    """m/s of cable"""
    acceleration: float
    """m/s²"""
    watch: float
    """s for which it must stay where it has stopped, with power and again without"""

    @property
    def text(self) -> str:
        """The step in words."""
        return (
            f"winch {self.winch + 1}, {self.trial} at {self.speed:g} m/s: check that it stops by itself and stays still"
        )

    @property
    def place(self) -> tuple[object, ...]:
        """Also which trial."""
        return (type(self), self.window, self.trial)

    @property
    def details(self) -> Mapping[str, Any]:
        """A journal must know that a winch is about to move."""
        return {"winch": self.winch + 1, "trial": self.trial.value, "speed": self.speed}

    @property
    def seconds(self) -> float:
        """Estimate."""
        return 4.0 + 2.0 * self.watch


RUNS_ON = "runs on"
"""the answer of `ProveStop` where the winch obeyed no stop"""
