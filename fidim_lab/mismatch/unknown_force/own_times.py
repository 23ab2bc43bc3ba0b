"""When a repeated force acts in each window, estimated from each window by itself.

Features are sin and cos of some harmonics of one frequency, in turn. With weights w of all windows and a phase φ of
each, the weights that a window feels are R(φ) w, each pair of harmonic k turned by k φ; w and the φ are found in turn.
Source: as `mismatch.scores.own_phase`, for any course.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from fidim_lab.mismatch.scores.thresholds import SCORES


@dataclass(frozen=True, eq=False)
class OwnTimes:
    """Windows' sums of squares with each in its own time."""

    grams: Float[np.ndarray, "W m m"]
    """of [shared, weights, residual], the weights those of all windows"""
    phases: Float[np.ndarray, " W"]
    """rad, of the lowest harmonic at each window's time 0"""
    cost: float
    """nats that the phases' freedom costs"""
    combined: Float[np.ndarray, "Q q"] | None = None
    """by which weights of harmonics follow from fewer: for knocks"""


def own_times(grams: Float[np.ndarray, "W m m"], shared: int, harmonics: int, inflation: float) -> OwnTimes:
    """The time of each window, and the grams by weights that are then the same for all.

    shared: how many shared parameters come before the weights. inflation: χ²/dof that counts as noise.
    """
    weights = slice(shared, grams.shape[1] - 1)
    curvature, gradient = grams[:, weights, weights], -grams[:, weights, -1]
    phases, found = _found(curvature, gradient, harmonics)
    turns = rotations(phases, harmonics, len(found))
    turned = grams.copy()
    turned[:, :, weights] = turned[:, :, weights] @ turns
    turned[:, weights] = np.swapaxes(turns, 1, 2) @ turned[:, weights]
    # how R(φ) w changes with φ: harmonic k, a quarter turn on, k times as fast
    across = rotations(np.array([np.pi / 2]), harmonics, len(found), often=False)[0] @ found
    across *= np.tile(np.repeat(np.arange(1, harmonics + 1), 2), len(found) // (2 * harmonics))
    moved = turns @ across
    return OwnTimes(turned, phases, cost_of(moved, curvature, inflation))


def cost_of(moved: Float[np.ndarray, "W Q"], curvature: Float[np.ndarray, "W Q Q"], inflation: float) -> float:
    """Nats that a phase of each window costs, by how its weights change with it: the prior is a whole turn."""
    certain = np.einsum("wi,wij,wj->w", moved, curvature, moved) / max(inflation, 1e-9)
    return 0.5 * float(np.log(np.maximum(2 * np.pi * certain, 1.0)).sum())


def rotations(
    phases: Float[np.ndarray, " W"], harmonics: int, size: int, *, often: bool = True
) -> Float[np.ndarray, "W Q Q"]:
    """R(φ) of weights by direction, harmonic, and sin before cos; often: harmonic k by k φ, else all by φ."""
    found = np.zeros((len(phases), size, size))
    pairs = 2 * harmonics
    for first in range(0, size, 2):
        angle = phases * ((first % pairs) // 2 + 1 if often else 1)
        cosine, sine = np.cos(angle), np.sin(angle)
        found[:, first, first], found[:, first, first + 1] = cosine, -sine
        found[:, first + 1, first], found[:, first + 1, first + 1] = sine, cosine
    return found


def _found(curvature: np.ndarray, gradient: np.ndarray, harmonics: int) -> tuple[np.ndarray, np.ndarray]:
    """Phases (W) and weights (Q), from the strongest common course of the windows' own lowest harmonics on."""
    size = gradient.shape[1]
    sine = np.arange(0, size, 2 * harmonics)
    lowest = np.ravel(np.column_stack([sine, sine + 1]))
    ridge = 1e-4 * float(np.diagonal(curvature.sum(axis=0)).max()) + 1e-300
    part = curvature[:, lowest[:, np.newaxis], lowest] + ridge * np.eye(len(lowest))
    own = np.linalg.solve(part, gradient[:, lowest, np.newaxis])[..., 0]
    gain = np.sqrt(np.maximum(np.einsum("wi,wi->w", own, gradient[:, lowest]), 0.0))
    size_of = np.maximum(np.linalg.norm(own, axis=1), 1e-300)
    # s sin θ + c cos θ is the real part of (c − i s) exp(i θ)
    pointers = (own[:, 1::2] - 1j * own[:, ::2]) * (gain / size_of)[:, np.newaxis]
    phases = np.angle(np.linalg.svd(pointers, full_matrices=False)[0][:, 0])
    angles = np.linspace(-np.pi, np.pi, SCORES.own_phase_phases, endpoint=False)
    every = rotations(angles, harmonics, size)
    weights = np.zeros(size)
    for _ in range(SCORES.own_phase_rounds):
        turns = rotations(phases, harmonics, size)
        back = np.swapaxes(turns, 1, 2)
        total = (back @ curvature @ turns).sum(axis=0) + ridge * np.eye(size)
        weights = np.linalg.solve(total, (back @ gradient[..., np.newaxis]).sum(axis=0))[:, 0]
        pointed = every @ weights
        gains = 2 * gradient @ pointed.T - ((pointed @ curvature) * pointed).sum(axis=2)
        phases = angles[np.argmax(gains, axis=1)]
    return phases, weights
