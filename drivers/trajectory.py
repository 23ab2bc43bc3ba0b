"""The commanded place of a winch, as an immutable function of time: one move of constant accelerations. Pure.

Drives in profile position mode carry such moves out by themselves; in cyclic position mode the host says them cycle by
cycle. Units are the caller's: metres outside the drivers, encoder counts inside.
"""

import math
from dataclasses import dataclass
from functools import cached_property

_NEGLIGIBLE = 1e-12
"""s; shorter parts are left out"""
_NOWHERE = 1e-9
"""m or counts: rounding, no way"""


@dataclass(frozen=True)
class Trajectory:
    """A way that ends at rest: up to speed, at speed, and down again; a triangle where it is short.

    One that begins too fast to stop at its target overshoots and comes back. Winches whose speeds and accelerations
    stand in the ratio of their ways need the same time and go in proportion all along: so cables that are taut at both
    ends and between them stay so on the way. Before its beginning it came at the velocity with which it begins.
    """

    t: float
    """monotonic s of its beginning"""
    start: float
    """place at that time"""
    target: float
    speed: float = 1.0
    """at most, > 0"""
    acceleration: float = 1.0
    """of both ramps, > 0"""
    velocity: float = 0.0
    """at the beginning"""

    @staticmethod
    def standing(t: float, place: float) -> "Trajectory":
        """At rest at a place from `t` on."""
        return Trajectory(t, place, place)

    @staticmethod
    def stopping(t: float, place: float, velocity: float, deceleration: float) -> "Trajectory":
        """From a velocity to rest."""
        rest = place + velocity * abs(velocity) / (2.0 * deceleration)
        return Trajectory(t, place, rest, abs(velocity) or 1.0, deceleration, velocity)

    @property
    def end(self) -> float:
        """Monotonic s from which on it rests."""
        return self.t + sum(seconds for _, seconds in self._parts)

    @property
    def is_stop(self) -> bool:
        """Whether it does nothing but come to rest."""
        return abs(self.target - self.start - self._overrun) <= _NOWHERE

    @property
    def _overrun(self) -> float:
        return self.velocity * abs(self.velocity) / (2.0 * self.acceleration)

    def at(self, t: float) -> tuple[float, float]:
        """Place and velocity at monotonic time `t`."""
        left = t - self.t
        place, velocity = self.start, self.velocity
        if left <= 0.0:
            return place + velocity * left, velocity
        for acceleration, seconds in self._parts:
            if left < seconds:
                return place + (velocity + 0.5 * acceleration * left) * left, velocity + acceleration * left
            place += (velocity + 0.5 * acceleration * seconds) * seconds
            velocity += acceleration * seconds
            left -= seconds
        return self.target, 0.0

    @cached_property
    def _parts(self) -> tuple[tuple[float, float], ...]:
        """Acceleration and seconds of each part."""
        ramp, velocity, overrun = self.acceleration, self.velocity, self._overrun
        way = self.target - self.start
        sign = math.copysign(1.0, way - overrun)
        stop = -math.copysign(ramp, velocity), abs(velocity) / ramp
        parts: list[tuple[float, float]] = []
        if self.is_stop:
            return (stop,) if velocity else ()
        if sign * velocity < 0.0:  # first to a stop, then back
            parts.append(stop)
            way, velocity = way - overrun, 0.0
        fast, far = abs(velocity), abs(way)
        peak = min(self.speed, math.sqrt(ramp * far + 0.5 * fast * fast))
        if peak > 0.0:
            change = abs(peak * peak - fast * fast) / (2.0 * ramp)
            parts.append((math.copysign(ramp, peak - fast) * sign, abs(peak - fast) / ramp))
            parts.append((0.0, (far - change - peak * peak / (2.0 * ramp)) / peak))
            parts.append((-sign * ramp, peak / ramp))
        return tuple((acceleration, seconds) for acceleration, seconds in parts if seconds > _NEGLIGIBLE)
