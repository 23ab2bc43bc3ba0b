"""Steps that move the robot or measure it at rest."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from procedures.steps.base import AfterPause, LastingStep, Lengths, Phase, Step

UNKNOWN_WAY = 0.5
"""m, what the time estimate assumes of a move whose start is not known"""


@dataclass(frozen=True, kw_only=True)
class Enable(Step):
    """Configure all winches, read back, power on, wait until winches and markers report. Values: encoder lengths."""

    phase: ClassVar[Phase] = Phase.PREPARING
    after_pause: ClassVar[AfterPause] = AfterPause.NOT_INTERRUPTED
    says: ClassVar[str] = "configure the winches, read back their limits, power on and hold"
    takes: ClassVar[float] = 2.0

    timeout: float = 5.0
    """s for the first samples"""

    @property
    def seconds_between(self) -> tuple[float, float]:
        """0.2 s of simulated drives, to a second and more on a bus."""
        return 0.2, self.seconds


@dataclass(frozen=True, kw_only=True)
class MoveTo(Step):
    """Move to cable lengths along a straight line in length space: all winches start and arrive together."""

    phase: ClassVar[Phase] = Phase.MOVING

    lengths: Lengths
    start: Lengths | None = None
    """where the move begins by plan; None where the robot happens to be"""
    speed: float
    """m/s of the cable with the longest way"""
    acceleration: float
    """m/s²"""
    tolerance: float
    """m of encoder error at which a winch has arrived"""
    way_point: bool = False
    """only passed through, because the straight way leaves the workspace"""

    @property
    def text(self) -> str:
        """The step in words."""
        where = " ".join(f"{length:.3f}" for length in self.lengths)
        return f"move {'by way of' if self.way_point else 'to'} lengths {where} m, at most {self.speed:g} m/s"

    @property
    def details(self) -> Mapping[str, Any]:
        """The target: after a crash the robot is somewhere on the way to it."""
        return {"lengths": [round(length, 6) for length in self.lengths]}

    @property
    def place(self) -> tuple[object, ...]:
        """Also where to."""
        return (type(self), self.window, self.lengths)

    @property
    def seconds(self) -> float:
        """Time of the trapezoidal profile over the longest way."""
        way = UNKNOWN_WAY if self.start is None else longest_way(self.start, self.lengths)
        return travel_time(way, self.speed, self.acceleration)

    @property
    def seconds_between(self) -> tuple[float, float]:
        """A robot whose place is not known may be there already."""
        return (0.0 if self.start is None else self.seconds), self.seconds


@dataclass(frozen=True, kw_only=True)
class Settle(Step):
    """Wait until the marker has come to rest, measured. Values: its mean position, m. FAIL after the time-out."""

    tolerance: float
    """m, peak to peak of each coordinate"""
    over: float
    """s"""
    timeout: float
    """s"""
    steadied: float = 0.0
    """s that somebody needs to steady the platform where it comes to no rest, for the time estimate only"""

    @property
    def text(self) -> str:
        """The step in words."""
        return (
            f"wait until the marker moves less than {self.tolerance * 1e3:g} mm peak to peak in {self.over:g} s "
            f"(at most {self.timeout:g} s)"
        )

    @property
    def seconds(self) -> float:
        """Estimate: the platform needs about as long again to come to rest."""
        return min(2.0 * self.over, self.timeout)

    @property
    def seconds_between(self) -> tuple[float, float]:
        """At rest from the start; or not in time, steadied, and looked at again."""
        again = self.steadied + self.over if self.steadied else 0.0
        return self.over, self.timeout + again


@dataclass(frozen=True, kw_only=True)
class Hold(Step):
    """All winches hold their position, and stand still."""

    says: ClassVar[str] = "hold all winches"
    takes: ClassVar[float] = 0.2
    """the encoders are looked at for a moment"""


@dataclass(frozen=True, kw_only=True)
class ReadEncoders(LastingStep):
    """Average the encoders and compare with the lengths asked for. Values: mean lengths, m."""

    lengths: Lengths
    tolerance: float
    """m"""

    @property
    def text(self) -> str:
        """The step in words."""
        return f"read the encoders for {self.over:g} s, at most {self.tolerance * 1e3:g} mm off"


@dataclass(frozen=True, kw_only=True)
class CheckTension(LastingStep):
    """Compare each cable's tension at rest, from the mean motor current, with its limits. Values: tensions, N."""

    limits: tuple[float, float]
    """N"""
    tolerance: float
    """part of a limit by which a tension from a motor current may be off"""

    @property
    def text(self) -> str:
        """The step in words."""
        low, high = self.limits
        return f"check every tension: {low:g} to {high:g} N, ±{self.tolerance:.0%} as it comes from motor currents"


def longest_way(start: Lengths, end: Lengths) -> float:
    """The largest change of any length, m."""
    return max(abs(b - a) for a, b in zip(start, end, strict=True))


def travel_time(way: float, speed: float, acceleration: float) -> float:
    """Duration of a trapezoidal (or, for short ways, triangular) velocity profile, s."""
    if way < speed**2 / acceleration:
        return 2.0 * math.sqrt(way / acceleration)
    return way / speed + speed / acceleration
