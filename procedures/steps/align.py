"""The step that compares the clocks of motion capture and drives."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from procedures.steps.base import AfterPause, Lengths, Phase, Step
from procedures.steps.window import GiveUp

if TYPE_CHECKING:
    from fidim_lab.model.closure import Closure

PLACES = "alignment"
"""folder of a run for what was recorded meanwhile"""


@dataclass(frozen=True, kw_only=True)
class Jog(Step):
    """Go to and fro between two places and record meanwhile; how late are the markers? Values: lag and its sd, s."""

    phase: ClassVar[Phase] = Phase.MOVING
    after_pause: ClassVar[AfterPause] = AfterPause.SAME_STEP

    ends: tuple[Lengths, Lengths]
    """m; the way between them has been checked and driven before"""
    signal: "Closure"
    """what lengths and markers both show of it"""
    duration: float
    """s"""
    speed: float
    """m/s of the cable with the longest way"""
    acceleration: float
    """m/s²"""
    tolerance: float
    """m of encoder error at which a winch has arrived"""
    sd: float
    """s that the lag may be uncertain by"""

    @property
    def text(self) -> str:
        """The step in words."""
        return f"move up and down for {self.duration:g} s and record, to measure the delay of the markers"

    @property
    def details(self) -> Mapping[str, Any]:
        """The two ends: after a crash the robot is somewhere between."""
        return {"lengths": [round(length, 6) for length in self.ends[0]]}

    @property
    def seconds(self) -> float:
        """Estimate."""
        return self.duration


@dataclass(frozen=True, kw_only=True)
class Told(GiveUp):
    """The result in words, which ends the procedure."""

    @property
    def text(self) -> str:
        """What is said."""
        return "delay of the markers"
