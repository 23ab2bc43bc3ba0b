"""The time grid of a batch: blocks of equal length, each with its Lobatto nodes, both ends included.

The states are integrated from node to node; the variational equation is collocated on the nodes of a block. For stiff
springs both are collocated, on the begin of the block and its Radau nodes (`stiff`).
"""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from jaxtyping import Float
from numpy.polynomial import legendre

from fidim_lab.arrays import Series

LARGEST_PHASE = 8.0
"""rad of the fastest oscillation in a block; at 10 states are good to 1e-9 of 10 cm, sensitivities to 1e-4"""


@dataclass(frozen=True)
class Resolution:
    """How finely time is divided."""

    intervals: int
    """k nodes after the first in each block"""
    block: float = 0.1
    """s"""
    stiff: bool = False
    """Radau nodes: what oscillates too fast for a block dies within it"""

    @property
    def for_stiff(self) -> "Resolution":
        """As good where cables are stiff: of two orders less, so with two nodes more."""
        return replace(self, intervals=self.intervals + 2, stiff=True)

    @property
    def halved(self) -> "Resolution":
        """With blocks half as long."""
        return replace(self, block=self.block / 2)

    def for_frequency(self, fastest: float) -> "Resolution":
        """As fine as an oscillation of `fastest` rad/s asks for; blocks are a whole part of the usual ones."""
        return replace(self, block=self.block / max(1, int(np.ceil(self.block * fastest / LARGEST_PHASE))))


QUICK = Resolution(intervals=8)
"""Four cables, 10 s: states to 6e-8 m, sensitivities to 4e-4: for the way to the optimum."""

FINE = Resolution(intervals=10)
"""States to 1e-8 m, sensitivities to 4e-6: for the optimum and what is said of it."""


@dataclass(frozen=True, eq=False)
class Grid:
    """Nodes of so many blocks."""

    blocks: int
    resolution: Resolution

    @staticmethod
    def covering(duration: float, resolution: Resolution) -> "Grid":
        """The shortest grid that reaches `duration` (s)."""
        return Grid(max(1, int(np.ceil(duration / resolution.block - 1e-9))), resolution)

    @property
    def nodes(self) -> int:
        """How many there are."""
        return self.blocks * self.resolution.intervals + 1

    @property
    def t(self) -> Series:
        """Time of every node, s."""
        inner = _collocation(self.resolution)[0][1:]
        ends = (np.arange(self.blocks)[:, np.newaxis] + inner) * self.resolution.block
        return np.concatenate([[0.0], ends.ravel()])

    @property
    def halved(self) -> "Grid":
        """As long, with blocks half as long."""
        return Grid(2 * self.blocks, self.resolution.halved)

    def tails(self, values: Float[np.ndarray, "W N d"], begin: float) -> Float[np.ndarray, " W"]:
        """Of what values at the nodes say of their integrals, what the last two orders of a block say at most.

        In the unit of the values times seconds: what is left out by a polynomial of that degree is hardly more.
        begin: s, before which blocks are not looked at.
        """
        k = self.resolution.intervals
        blocks = np.arange(round(begin / self.resolution.block), self.blocks)
        inside = blocks[:, np.newaxis] * k + np.arange(k + 1)
        values_of = legendre.legvander(2 * _collocation(self.resolution)[0] - 1, k)
        last = np.linalg.inv(values_of)[-2:]
        largest = np.abs(last @ values[:, inside]).max(axis=(1, 2, 3), initial=0.0)
        return largest * self.resolution.block / k

    @property
    def quadrature(self) -> Float[np.ndarray, "k+1 k+1"]:
        """∫ from the begin of a block to node i of the polynomial through all its nodes: Σ_j Q_ij f_j, s."""
        return _collocation(self.resolution)[1] * self.resolution.block


@cache
def lobatto(intervals: int) -> tuple[Series, Float[np.ndarray, "k+1 k+1"]]:
    """The k + 1 Lobatto nodes of [0, 1] and the matrix of Lobatto IIIA (order 2 k)."""
    derivative = legendre.legder(np.eye(intervals + 1)[intervals])
    x = np.concatenate([[-1.0], np.sort(legendre.legroots(derivative)), [1.0]])
    # Legendre polynomials rather than powers: well conditioned for any k
    values = legendre.legvander(x, intervals)
    integrals = [legendre.legval(x, legendre.legint(row, lbnd=-1)) for row in np.eye(intervals + 1)]
    nodes, matrix = (x + 1) / 2, np.stack(integrals, axis=1) @ np.linalg.inv(values) / 2
    nodes.setflags(write=False)
    matrix.setflags(write=False)
    return nodes, matrix


@cache
def radau(intervals: int) -> tuple[Series, Float[np.ndarray, "k+1 k+1"]]:
    """0 and the k Radau nodes of (0, 1], with the matrix of Radau IIA (order 2 k − 1, L-stable); 0 has no weight."""
    polynomial = np.eye(intervals + 1)[intervals] - np.eye(intervals + 1)[intervals - 1]
    x = np.sort(legendre.legroots(polynomial))
    x[-1] = 1.0
    values = legendre.legvander(x, intervals - 1)
    integrals = [legendre.legval(x, legendre.legint(row, lbnd=-1)) for row in np.eye(intervals)]
    nodes, matrix = np.zeros(intervals + 1), np.zeros((intervals + 1, intervals + 1))
    nodes[1:], matrix[1:, 1:] = (x + 1) / 2, np.stack(integrals, axis=1) @ np.linalg.inv(values) / 2
    nodes.setflags(write=False)
    matrix.setflags(write=False)
    return nodes, matrix


def _collocation(resolution: Resolution) -> tuple[Series, Float[np.ndarray, "k+1 k+1"]]:
    return radau(resolution.intervals) if resolution.stiff else lobatto(resolution.intervals)
