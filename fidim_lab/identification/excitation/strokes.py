"""Strokes of the winches: out, to and fro and back again along one line in length space, each from rest to rest.

A stroke is a move that a drive makes by itself in profile position mode: constant acceleration, then the same
deceleration. So a `Chain` of strokes is exactly known from its set-points and their times, whatever the drive: nothing
is streamed, only the time of each set-point matters. With the times given everything is linear in the direction.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Protocol

import numpy as np
from jaxtyping import Complex, Float

from fidim_lab.arrays import PerCable
from fidim_lab.errors import OurBugError

FINEST = 0.012
"""s, the longest step of integration while the winches move"""
COARSE = 0.025
"""s, the same while they hold"""


@dataclass(frozen=True)
class Pattern:
    """When the strokes happen, and how far they go: +1, −1, … and back to 0."""

    half: float
    """s between the middles of two strokes: half the period with which the winches swing"""
    turns: int
    """how often they turn around; 1 is out and back"""
    duty: float
    """part of `half` that a whole stroke (from +1 to −1) takes; the first and the last go half the way"""

    @property
    def whole(self) -> float:
        """Duration of a stroke over 2, s."""
        return self.duty * self.half

    @property
    def acceleration(self) -> float:
        """Of the unit chain, 1/s²."""
        return 8.0 / self.whole**2

    @property
    def speed(self) -> float:
        """Largest of the unit chain, 1/s."""
        return 4.0 / self.whole

    @property
    def targets(self) -> tuple[float, ...]:
        """Where each stroke goes."""
        return (*((-1.0) ** k for k in range(self.turns)), 0.0)

    @property
    def durations(self) -> Float[np.ndarray, " strokes"]:
        """s"""
        ways = np.abs(np.diff([0.0, *self.targets]))
        return self.whole * np.sqrt(ways / 2.0)

    @property
    def starts(self) -> Float[np.ndarray, " strokes"]:
        """s since the first one begins."""
        middles = self.half * np.arange(self.turns + 1)
        begins = middles - self.durations / 2
        return begins - begins[0]

    @property
    def seconds(self) -> float:
        """From the first stroke's begin to the last one's end."""
        return float(self.starts[-1] + self.durations[-1])

    def pieces(self) -> Float[np.ndarray, "pieces 3"]:
        """(begin, duration, acceleration) of each piece of constant acceleration of the unit chain, 1/s²."""
        ways = np.diff([0.0, *self.targets])
        signs = np.sign(ways) * self.acceleration
        halves = self.durations / 2
        up = np.column_stack([self.starts, halves, signs])
        down = np.column_stack([self.starts + halves, halves, -signs])
        return np.stack([up, down], axis=1).reshape(-1, 3)

    def response(self, rates: Complex[np.ndarray, " modes"]) -> Complex[np.ndarray, " modes"]:
        """∫ e^{s(T − t)} ü dt over the unit chain, T its end, for each s: y(T) = e^{sT} y(0) − gain·direction ∫."""
        return self.responses(rates, np.array([self.seconds]))[:, 0]

    def responses(
        self, rates: Complex[np.ndarray, " modes"], t: Float[np.ndarray, " N"]
    ) -> Complex[np.ndarray, "modes N"]:
        """∫ e^{s(t − t′)} ü dt′ until each time t, s since the chain's begin."""
        begin, duration, acceleration = (column[:, np.newaxis] for column in self.pieces().T)
        since, ended = np.maximum(t - begin, 0.0), np.maximum(t - begin - duration, 0.0)
        return np.array([(acceleration * (np.exp(s * since) - np.exp(s * ended)) / s).sum(axis=0) for s in rates])

    def motion(self, t: Float[np.ndarray, " N"]) -> tuple[Float[np.ndarray, " N"], Float[np.ndarray, " N"]]:
        """Offset of the unit chain, and its acceleration (1/s²), at times since its begin (s)."""
        begin, duration, acceleration = (column[:, np.newaxis] for column in self.pieces().T)
        since, ended = np.maximum(t - begin, 0.0), np.maximum(t - begin - duration, 0.0)
        offsets = (acceleration / 2 * (since**2 - ended**2)).sum(axis=0)
        return offsets, (acceleration * ((since > 0) & (ended == 0))).sum(axis=0)


@dataclass(frozen=True, eq=False)
class Chain:
    """A pattern along a direction in length space."""

    pattern: Pattern
    direction: PerCable
    """m: the offset from the equilibrium's lengths at +1"""

    @property
    def longest(self) -> float:
        """m, the largest offset of any cable."""
        return float(np.abs(self.direction).max())

    @property
    def speed(self) -> float:
        """m/s, the largest of any cable."""
        return self.longest * self.pattern.speed

    @property
    def acceleration(self) -> float:
        """m/s²"""
        return self.longest * self.pattern.acceleration

    @property
    def offsets(self) -> Float[np.ndarray, "strokes n"]:
        """Where each stroke goes, m from the equilibrium's lengths."""
        return np.outer(self.pattern.targets, self.direction)

    def scaled(self, factor: float) -> "Chain":
        """The same, so much larger."""
        return replace(self, direction=factor * self.direction)


@dataclass(frozen=True, eq=False)
class Timeline:
    """Chains one after another, cut into steps of integration, and rest after them."""

    steps: Float[np.ndarray, " N"]
    """s"""
    patterns: Float[np.ndarray, "N chains"]
    """acceleration of each unit chain in each step, 1/s²"""

    @property
    def t(self) -> Float[np.ndarray, " N+1"]:
        """Ends of the steps, s."""
        return np.concatenate([[0.0], np.cumsum(self.steps)])

    def accelerations(self, directions: Float[np.ndarray, "chains n"]) -> Float[np.ndarray, "N n"]:
        """l̈, m/s²."""
        return self.patterns @ directions


class Moves(Protocol):
    """Anything that moves in pieces of constant acceleration."""

    def pieces(self) -> Float[np.ndarray, "pieces 3"]:
        """(begin, duration, acceleration) of each, for a unit way."""
        ...


def timeline(
    patterns: Sequence[Moves], begins: Sequence[float], seconds: float, count: int, finest: float = FINEST
) -> Timeline:
    """Exactly `count` steps for patterns that begin at these times (s), until `seconds`; those over take no time.

    finest: s, the longest step while they move.

    A fixed number lets compiled loops be reused. Raises OurBugError where it is too small.
    """
    pieces = [pattern.pieces() + np.array([begin, 0.0, 0.0]) for pattern, begin in zip(patterns, begins, strict=True)]
    table = np.concatenate([np.zeros((1, 3)), *pieces])
    edges = np.unique(np.round([*table[:, 0], *table[:, :2].sum(axis=1), seconds], 9))
    edges = edges[edges <= seconds + 1e-9]
    moving = float(table[:, :2].sum(axis=1).max())
    longest = [finest if b <= moving + 1e-9 else COARSE for b in edges[1:]]
    parts = [
        np.linspace(a, b, 1 + max(1, math.ceil((b - a) / step - 1e-6)))[1:]
        for (a, b), step in zip(pairwise(edges), longest, strict=True)
    ]
    ends = np.concatenate(parts)
    if len(ends) > count:
        raise OurBugError(f"Excitation: {len(ends)} steps of integration, only {count} were foreseen.")
    t = np.concatenate([[0.0], ends, np.full(count - len(ends), seconds)])
    middles = (t[1:] + t[:-1]) / 2
    values = np.zeros((count, len(patterns)))
    for k, p in enumerate(pieces):
        for begin, duration, acceleration in p:
            values[(middles > begin) & (middles < begin + duration), k] = acceleration
    return Timeline(np.diff(t), values)
