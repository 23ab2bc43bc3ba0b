"""Motion of a shaft as pieces of constant acceleration: exact at any time, no integration."""

import math
from dataclasses import dataclass
from typing import NamedTuple

_NEGLIGIBLE = 1e-12
"""s; shorter pieces are left out"""
_LINGERING = 1e-6
"""part of a glide for which its speed still shows at its end: who looks just then sees motion, as with a real one"""


class ShaftMotion(NamedTuple):
    """Where a shaft is and how it moves: counts, counts/s, counts/s²."""

    position: float
    velocity: float = 0.0
    acceleration: float = 0.0


@dataclass(frozen=True, slots=True)
class _Piece:
    start: float
    motion: ShaftMotion


@dataclass(frozen=True, slots=True)
class Profile:
    """A motion that begins at some time and ends at rest."""

    pieces: tuple[_Piece, ...]
    end: float
    """s from which on the shaft stands"""
    rest: ShaftMotion
    """where it then stands"""

    def at(self, t: float) -> ShaftMotion:
        """The motion at time t (s); before its beginning, where it begins."""
        if t >= self.end:
            return self.rest
        for piece in reversed(self.pieces):
            if t >= piece.start:
                return _after(piece.motion, t - piece.start)
        return self.pieces[0].motion


def standing(position: float) -> Profile:
    """A shaft that stands at `position` (counts) for ever."""
    return Profile((), -math.inf, ShaftMotion(position))


def stop(t: float, motion: ShaftMotion, deceleration: float) -> Profile:
    """From `motion` at time t to rest with `deceleration` (counts/s², > 0)."""
    speed = abs(motion.velocity)
    travel = speed * motion.velocity / (2.0 * deceleration)
    braking = (-math.copysign(deceleration, motion.velocity), speed / deceleration)
    return _chain(t, motion, [braking], motion.position + travel)


def glide(t: float, position: float, target: float, duration: float) -> Profile:
    """At constant speed from `position` at time t to `target` in `duration` (s), then at rest."""
    if position == target:
        return standing(target)
    moving = ShaftMotion(position, (target - position) / duration)
    return _chain(t, moving, [(0.0, duration * (1.0 + _LINGERING))], target)


def trapezoid(
    t: float, motion: ShaftMotion, target: float, speed: float, acceleration: float, deceleration: float
) -> Profile:
    """From `motion` at time t to rest at `target`: profile position mode of CiA 402.

    Counts, counts/s, counts/s²; limits positive, except that a speed of 0 goes nowhere but to rest. A shaft too fast
    to stop at the target overshoots and comes back; one faster than `speed` slows down first.
    """
    if speed <= 0.0:
        return stop(t, motion, deceleration)
    overrun = motion.velocity * abs(motion.velocity) / (2.0 * deceleration)
    direction = math.copysign(1.0, target - motion.position - overrun)
    distance = direction * (target - motion.position)
    along = direction * motion.velocity
    phases: list[tuple[float, float]] = []
    if along < 0.0:  # first stop, then go back
        phases.append((deceleration, -along / deceleration))
        distance += along * along / (2.0 * deceleration)
        along = 0.0
    if along > speed:
        phases.append((-deceleration, (along - speed) / deceleration))
        peak = speed
        cruise = distance - along * along / (2.0 * deceleration)
    else:
        ramps = 0.5 / acceleration + 0.5 / deceleration  # distance of both ramps for each (counts/s)²
        peak = min(speed, math.sqrt(max(0.0, (distance + 0.5 * along * along / acceleration) / ramps)))
        phases.append((acceleration, (peak - along) / acceleration))
        cruise = distance + 0.5 * along * along / acceleration - peak * peak * ramps
    if peak > 0.0:
        phases += [(0.0, cruise / peak), (-deceleration, peak / deceleration)]
    return _chain(t, motion, [(direction * a, duration) for a, duration in phases], target)


def _chain(t: float, motion: ShaftMotion, phases: list[tuple[float, float]], target: float) -> Profile:
    pieces: list[_Piece] = []
    for acceleration, duration in phases:
        if duration > _NEGLIGIBLE:
            motion = ShaftMotion(motion.position, motion.velocity, acceleration)
            pieces.append(_Piece(t, motion))
            motion = _after(motion, duration)
            t += duration
    return Profile(tuple(pieces), t if pieces else -math.inf, ShaftMotion(target))


def _after(motion: ShaftMotion, dt: float) -> ShaftMotion:
    v, a = motion.velocity, motion.acceleration
    return ShaftMotion(motion.position + (v + 0.5 * a * dt) * dt, v + a * dt, a)
