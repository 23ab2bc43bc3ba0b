"""The step of `compare`: explain the recordings so far, and propose a further window where one is needed."""

from dataclasses import dataclass
from enum import StrEnum
from typing import ClassVar

from procedures.steps.base import Result, Step


class Clarity(StrEnum):
    """The answers of `Explain`."""

    CLEAR = "clear"
    """the verdict stands; the reason says which"""
    UNCLEAR = "unclear"
    """the values say which window would tell most: lengths, displacement of x and y, marker at rest; m"""
    STUCK = "stuck"
    """not clear, and no further window of this kind would help; the reason says why"""


@dataclass(frozen=True, kw_only=True)
class Explain(Step):
    """Explain the recording, as `fidim explain` does, in a process of its own; the robot is held meanwhile."""

    says: ClassVar[str] = "explain what was recorded; propose the next window where the verdict is not clear"

    number: int
    """of this explanation in the run, from 1"""
    estimate: float
    """s"""

    @property
    def place(self) -> tuple[object, ...]:
        """Also which."""
        return (type(self), self.number)

    @property
    def seconds(self) -> float:
        """Estimate."""
        return self.estimate

    @property
    def expected(self) -> Result:
        """A clear verdict: how many windows more there will be, nobody knows beforehand."""
        return Result(answer=Clarity.CLEAR)
