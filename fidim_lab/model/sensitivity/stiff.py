"""Motions on stiff springs: collocated on the Radau nodes of each block, by Newton's method.

Cables of 10⁶ N/m swing at hundreds of rad/s. Explicit steps must follow that for as long as the motion lasts, though it
dies in the first tenths of a second and shifts no marker by more than its noise. Radau IIA is L-stable: what is too
fast for a block (`grid.LARGEST_PHASE` rad and more in it) is gone at its end, what is slower is followed as usual, and
the cables stretch as the slow motion asks, to all orders. The cost does not depend on the stiffness.

Only ν = [v; ω; ξ] at the nodes is unknown: position and rotation follow from it by quadrature (as in `variation`, whose
table of derivatives gives the Newton steps).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from fidim_lab.model.batch import over_samples
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.equations import derivatives
from fidim_lab.model.sensitivity.grid import Grid

ROUNDS = 12
"""Newton steps a block; three or four are usual"""
SETTLED = 1e-5
"""m/s and rad/s: after a step no larger the next would be below 1e-9"""
WILD = 1e3
"""m/s or rad/s: a step so large is no motion of a platform; there is no solution near the guess"""
TURNS, ROUNDING = 10, 1e-13
"""iterations of the rotation within a block, each a tenth of the one before, and the last one's size"""


@dataclass(frozen=True, eq=False)
class Began:
    """W windows at the begin of a block."""

    positions: Float[np.ndarray, "W 3"]
    rotations: Float[np.ndarray, "W 3 3"]
    moving: Float[np.ndarray, "W m"]
    """[v; ω; ξ]"""


@dataclass(frozen=True, eq=False)
class Followed:
    """W motions at N nodes; NaN from the block on that has no solution."""

    positions: Float[np.ndarray, "W N 3"]
    rotations: Float[np.ndarray, "W N 3 3"]
    moving: Float[np.ndarray, "W N m"]
    slopes: Float[np.ndarray, "W N s"]
    """[v̇; ξ̇; τ]"""


def follow(
    mechanism: Mechanism,
    grid: Grid,
    begins: Float[np.ndarray, " W"],
    constants: Float[np.ndarray, "W constants"],
    began: Began,
    nearby: Callable[[Began, float], Float[np.ndarray, "W k+1 6"]],
) -> Followed:
    """The motions from `began` on, at the nodes of a stiff grid. begins: s on each window's own clock.

    nearby: twists at the nodes of the block that begins so and then (s of the grid), by a motion much alike (of rigid
    cables), from which Newton's method begins; NaN where unknown.
    """
    count, m, k, t = len(begins), began.moving.shape[1], grid.resolution.intervals, grid.t
    positions, rotations = np.empty((count, grid.nodes, 3)), np.empty((count, grid.nodes, 3, 3))
    moving = np.empty((count, grid.nodes, m))
    positions[:, 0], rotations[:, 0], moving[:, 0] = began.positions, began.rotations, began.moving
    for first in range(0, grid.nodes - 1, k):
        inner = slice(first + 1, first + k + 1)
        times = begins[:, np.newaxis] + t[inner]
        block = _Block(mechanism, grid.quadrature[1:, 1:], times, constants, began)
        guess = np.repeat(began.moving[:, np.newaxis], k, axis=1)
        alike = nearby(began, float(t[first]))
        guess[..., :6] += np.nan_to_num(alike[:, 1:] - alike[:, :1])
        positions[:, inner], rotations[:, inner], moving[:, inner] = block.solved(guess)
        began = Began(positions[:, first + k], rotations[:, first + k], moving[:, first + k])
    stamps = begins[:, np.newaxis] + t
    slopes = _table(mechanism, stamps, positions, rotations, moving, constants)[0]
    return Followed(positions, rotations, moving, slopes)


@dataclass(frozen=True, eq=False)
class _Block:
    mechanism: Mechanism
    quadrature: Float[np.ndarray, "k k"]
    times: Float[np.ndarray, "W k"]
    constants: Float[np.ndarray, "W constants"]
    began: Began

    def solved(self, moving: Float[np.ndarray, "W k m"]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Positions, rotations and ν at the inner nodes, from a guess of ν."""
        size = np.full(len(moving), np.inf)
        gibbs = self.quadrature @ moving[..., 3:6] / 2
        for _ in range(ROUNDS):
            positions, rotations, gibbs = self._poses(moving, gibbs)
            slopes, table = _table(self.mechanism, self.times, positions, rotations, moving, self.constants)
            rates = slopes[..., : moving.shape[2]]
            gap = moving - self.began.moving[:, np.newaxis] - self.quadrature @ rates
            step = _newton(self.quadrature, table, rotations, gap)
            size = np.abs(step).max(axis=(1, 2))
            moving = np.where(size[:, np.newaxis, np.newaxis] < WILD, moving - step, np.nan)
            if (size[np.isfinite(size)] <= SETTLED).all():
                break
        moving = np.where(size[:, np.newaxis, np.newaxis] < 10 * SETTLED, moving, np.nan)
        return *self._poses(moving, gibbs)[:2], moving

    def _poses(
        self, moving: Float[np.ndarray, "W k m"], gibbs: Float[np.ndarray, "W k 3"]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """p = p₀ + ∫ v and R = R(g) R₀ with ġ = ½ (ω + ω × g + g (g·ω)), on the nodes, and g, near which it was."""
        positions = self.began.positions[:, np.newaxis] + self.quadrature @ moving[..., :3]
        spin, half = moving[..., 3:6], self.quadrature / 2
        for _ in range(TURNS):
            along = gibbs * (gibbs * spin).sum(axis=-1, keepdims=True)
            before, gibbs = gibbs, half @ (spin + _cross(spin, gibbs) + along)
            if not (np.abs(gibbs - before) > ROUNDING).any():
                break
        return positions, _rotation(gibbs) @ self.began.rotations[:, np.newaxis], gibbs


def _newton(
    quadrature: Float[np.ndarray, "k k"],
    table: Float[np.ndarray, "W k m c"],
    rotations: Float[np.ndarray, "W k 3 3"],
    gap: Float[np.ndarray, "W k m"],
) -> Float[np.ndarray, "W k m"]:
    """The step that closes the gaps to first order: (1 − Q E − Q D Q T) δν = gap, with δq̇ = T δν."""
    count, k, m = gap.shape
    by_pose, by_moving = table[..., :6], table[..., 6 : 6 + m]
    twice = (quadrature[:, np.newaxis, :] * quadrature.T).reshape(k * k, k)  # (i, l), j: Q_ij Q_jl
    through = (twice @ by_pose.reshape(count, k, 6 * m)).reshape(count, k, k, m, 6)
    feedback = quadrature[:, :, np.newaxis, np.newaxis] * by_moving[:, np.newaxis]
    feedback[..., :3] += through[..., :3]
    feedback[..., 3:6] += through[..., 3:] @ np.swapaxes(rotations, -1, -2)[:, np.newaxis]
    system = np.eye(m * k) - feedback.transpose(0, 1, 3, 2, 4).reshape(count, m * k, m * k)
    known = np.isfinite(system).all(axis=(1, 2)) & np.isfinite(gap).all(axis=(1, 2))
    step = np.full((count, m * k), np.nan)
    step[known] = np.linalg.solve(system[known], gap[known].reshape(-1, m * k, 1))[..., 0]
    return step.reshape(count, k, m)


def _table(
    mechanism: Mechanism,
    times: Float[np.ndarray, "W K"],
    positions: np.ndarray,
    rotations: np.ndarray,
    moving: np.ndarray,
    constants: np.ndarray,
) -> tuple[Float[np.ndarray, "W K s"], Float[np.ndarray, "W K m c"]]:
    """[v̇; ξ̇; τ], and derivatives of the rates by [δp; δφ; δν; constants]."""
    shape = times.shape
    given = (times, positions, rotations, moving, np.repeat(constants, shape[1], axis=0))
    slopes, flat = over_samples(derivatives(mechanism).now(), times.size, *given)
    return slopes.reshape(*shape, -1), flat.reshape(*shape, moving.shape[2], -1)


def _cross(a: Float[np.ndarray, "W k 3"], b: Float[np.ndarray, "W k 3"]) -> Float[np.ndarray, "W k 3"]:
    """As numpy's, which takes five times as long for so few vectors."""
    found = np.empty_like(b)
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        found[..., k] = a[..., i] * b[..., j] - a[..., j] * b[..., i]
    return found


def _rotation(gibbs: Float[np.ndarray, "W k 3"]) -> Float[np.ndarray, "W k 3 3"]:
    """R = I + 2 ([g]× + [g]×²) / (1 + g·g)."""
    cross = np.zeros((*gibbs.shape, 3))
    cross[..., 0, 1], cross[..., 0, 2], cross[..., 1, 2] = -gibbs[..., 2], gibbs[..., 1], -gibbs[..., 0]
    cross = cross - np.swapaxes(cross, -1, -2)
    size = 1 + (gibbs * gibbs).sum(axis=-1)[..., np.newaxis, np.newaxis]
    return np.eye(3) + 2 * (cross + cross @ cross) / size
