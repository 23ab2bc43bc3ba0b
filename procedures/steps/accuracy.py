"""The step of a plan that names an accuracy: is the body known well enough already?"""

from dataclasses import dataclass
from typing import ClassVar

from fidim_lab.data.records import Accuracy
from procedures.steps.base import AfterPause, Step

REACHED = "reached"
"""the answer of `CheckAccuracy` where no further window is needed"""


@dataclass(frozen=True, kw_only=True)
class CheckAccuracy(Step):
    """Identify from the windows so far, in a process of its own. Answer REACHED, or none; the reason says how far."""

    after_pause: ClassVar[AfterPause] = AfterPause.NOT_INTERRUPTED
    takes: ClassVar[float] = 8.0

    accuracy: Accuracy

    @property
    def text(self) -> str:
        """The step in words."""
        return f"identify from the windows so far: {self.accuracy.says} is wanted"
