"""Steps that compare lengths with markers: a first jog of each winch, and a check of each place."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from procedures.steps.base import AfterPause, Phase, Step

SWINGS = "swings"
"""the answer of `TryWinches` where the platform did not come to rest"""


@dataclass(frozen=True, kw_only=True)
class TryWinches(Step):
    """Move each winch a few millimetres to and back, one after another: do marker and tensions answer as they should?

    Once, before anything moves farther. Values: lengths at the end, m. FAIL where an answer is wrong (the reason says
    what would explain it), or with the answer SWINGS where the platform does not rest.
    """

    phase: ClassVar[Phase] = Phase.MOVING

    winches: int
    way: float
    """m of cable"""
    speed: float
    """m/s"""
    acceleration: float
    """m/s²"""
    over: float
    """s of looking after each move"""
    timeout: float
    """s to come to rest first"""

    @property
    def text(self) -> str:
        """The step in words."""
        return (
            f"move each winch {self.way * 1e3:g} mm and back; check the place of the marker, and that marker and "
            "tensions respond as in the model"
        )

    @property
    def details(self) -> Mapping[str, Any]:
        """A journal must know that winches are about to move."""
        return {"way": self.way}

    @property
    def seconds(self) -> float:
        """Estimate: a look before, one after each winch, and the way back."""
        moves = (1 + self.winches) * (self.way / self.speed + self.speed / self.acceleration)
        return (1 + self.winches) * self.over + moves


@dataclass(frozen=True, kw_only=True)
class ComparePlace(Step):
    """Is the marker, which rested at `marker`, where the lengths put it? FAIL says what would explain it."""

    after_pause: ClassVar[AfterPause] = AfterPause.NOT_INTERRUPTED

    marker: tuple[float, ...]
    """m, where it rested; empty in a list of what will be done"""
    off: float
    """m that it may be off"""

    @property
    def text(self) -> str:
        """The step in words."""
        return f"compare the marker with its place by the lengths, at most {self.off * 1e3:g} mm off"
