"""Where a winch should be from cycle to cycle in cyclic synchronous position mode. Pure; counts and seconds."""

import math
from dataclasses import dataclass
from typing import Protocol


class Trajectory(Protocol):
    """A way that ends at rest."""

    @property
    def duration(self) -> float:
        """s until it rests."""
        ...

    def at(self, t: float) -> tuple[float, float]:
        """Position (counts) and velocity (counts/s) at t s after its beginning; at rest after its end."""
        ...


@dataclass(frozen=True)
class Trapezoid:
    """From rest to rest with constant acceleration, speed, deceleration; a triangle where the way is short.

    Winches whose speeds and accelerations stand in the ratio of their ways need the same time and go in proportion all
    along: so cables that are taut at both ends and between them stay so on the way.
    """

    start: float
    """counts"""
    goal: float
    speed: float
    """counts/s, > 0"""
    acceleration: float
    """counts/s², > 0"""

    @property
    def _peak(self) -> float:
        return min(self.speed, math.sqrt(abs(self.goal - self.start) * self.acceleration))

    @property
    def duration(self) -> float:
        """s."""
        peak = self._peak
        return abs(self.goal - self.start) / peak + peak / self.acceleration if peak > 0.0 else 0.0

    def at(self, t: float) -> tuple[float, float]:
        """Position and velocity."""
        whole, peak = self.duration, self._peak
        sign, ramp = math.copysign(1.0, self.goal - self.start), peak / self.acceleration
        if t <= 0.0:
            return self.start, 0.0
        if t >= whole:
            return self.goal, 0.0
        if t < ramp:
            return self.start + sign * self.acceleration * t**2 / 2.0, sign * self.acceleration * t
        left = whole - t
        if left < ramp:
            return self.goal - sign * self.acceleration * left**2 / 2.0, sign * self.acceleration * left
        return self.start + sign * peak * (t - ramp / 2.0), sign * peak


@dataclass(frozen=True)
class StopRamp:
    """From a velocity to rest, with constant deceleration."""

    start: float
    """counts"""
    velocity: float
    """counts/s"""
    deceleration: float
    """counts/s², > 0"""

    @property
    def duration(self) -> float:
        """s."""
        return abs(self.velocity) / self.deceleration

    def at(self, t: float) -> tuple[float, float]:
        """Position and velocity."""
        t = min(max(t, 0.0), self.duration)
        slower = math.copysign(self.deceleration, self.velocity)
        return self.start + self.velocity * t - slower * t**2 / 2.0, self.velocity - slower * t
