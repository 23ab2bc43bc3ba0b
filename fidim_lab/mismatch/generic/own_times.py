"""What comes back again and again, and meets every window at another time: when, from what each window says by itself.

Features are sin and cos of some harmonics of one frequency, in turn. With weights w of all windows and a phase φ of
each, the weights that a window feels are R(φ) w, each pair of harmonic k turned by k φ; w and the φ are found in turn.
Source: as `mismatch.own_phase`, for any course.

Knocks that are short beside their period have so many harmonics that these must be taken together: of a Gaussian of
width s harmonic k has the share a_k = exp(−(2π f k s)²/2), and the force that all knocks have is the only weight.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

ROUNDS = 6
"""of finding phases and weights in turn"""
PHASES = 72
"""angles that are tried"""
KNOCK_PHASES = 48
WIDTHS = (0.02, 0.04, 0.08, 0.16)
"""s, standard deviation of a knock"""
LEADERS = 3
"""windows, of which each in turn says first which force all feel"""
RIDGE = 1e-4
"""of the curvature by the loudest weight: harmonics of which the windows tell next to nothing stay small"""


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
    certain = np.einsum("wi,wij,wj->w", moved, curvature, moved) / max(inflation, 1e-9)
    return OwnTimes(turned, phases, 0.5 * float(np.log(np.maximum(2 * np.pi * certain, 1.0)).sum()))


def knocks(
    grams: Float[np.ndarray, "W m m"], shared: int, directions: int, frequency: float, inflation: float
) -> OwnTimes:
    """As `own_times` for one force, and of the widths that are tried the one that takes most.

    directions: of the force, each with a constant and then sin and cos of every harmonic (of `frequency`, Hz).
    """
    count, harmonics = len(grams), (grams.shape[1] - 1 - shared) // directions // 2
    weights = slice(shared, grams.shape[1] - 1)
    curvature = grams[:, weights, weights].reshape(count, directions, -1, directions, 2 * harmonics + 1)
    gradient = -grams[:, weights, -1].reshape(count, directions, -1)
    angles = np.linspace(-np.pi, np.pi, KNOCK_PHASES, endpoint=False)
    found: list[tuple[_Common, float]] = []
    for width in WIDTHS:
        courses = _knock(angles, frequency, width, harmonics)
        by_angle = np.einsum("ak,wdkea->awde", courses, curvature @ courses.T, optimize=True)
        pull = np.einsum("ak,wdk->awd", courses, gradient, optimize=True)
        found.append((_common_force(by_angle, pull), width))
    common, width = max(found, key=lambda one: one[0].gain)
    phases, force = angles[common.places], common.force
    courses = _knock(phases, frequency, width, harmonics)
    combine = np.einsum("de,wk->wdke", np.eye(directions), courses).reshape(count, -1, directions)
    whole = np.zeros((count, grams.shape[1], shared + directions + 1))
    whole[:, range(shared), range(shared)] = 1.0
    whole[:, weights, shared:-1] = combine
    whole[:, -1, -1] = 1.0
    turned = np.swapaxes(whole, 1, 2) @ grams @ whole
    step = 0.5 * (angles[1] - angles[0])
    later = _knock(phases + step, frequency, width, harmonics) - _knock(phases - step, frequency, width, harmonics)
    moved = np.einsum("d,wk->wdk", force, later / (2 * step))
    certain = np.einsum("wdk,wdkel,wel->w", moved, curvature, moved, optimize=True) / max(inflation, 1e-9)
    cost = 0.5 * float(np.log(np.maximum(2 * np.pi * certain, 1.0)).sum())
    at_zero = _knock(np.zeros(1), frequency, width, harmonics)[0]
    return OwnTimes(turned, phases, cost, np.kron(np.eye(directions), at_zero[:, np.newaxis]))


def _knock(phases: np.ndarray, frequency: float, width: float, harmonics: int) -> Float[np.ndarray, "A K"]:
    """A train of Gaussians at each phase by a constant and sin and cos of every harmonic; 1 at the height of one."""
    k = np.arange(1, harmonics + 1)
    shares = np.exp(-((2 * np.pi * frequency * k * width) ** 2) / 2)
    found = np.zeros((len(phases), 2 * harmonics + 1))
    found[:, 0] = 0.5
    found[:, 1::2] = -shares * np.sin(k * phases[:, np.newaxis])
    found[:, 2::2] = shares * np.cos(k * phases[:, np.newaxis])
    return found / (0.5 + shares.sum())


@dataclass(frozen=True, eq=False)
class _Common:
    """One force of all windows."""

    gain: float
    """χ² taken"""
    places: Int[np.ndarray, " W"]
    """of each window's phase among those that were tried"""
    force: Float[np.ndarray, " d"]


def _common_force(curvature: Float[np.ndarray, "A W d d"], pull: Float[np.ndarray, "A W d"]) -> _Common:
    """The force that takes most, and when each window feels it."""
    count = curvature.shape[2]
    ridge = 1e-9 * float(np.trace(curvature.sum(axis=(0, 1)))) / curvature.shape[0] * np.eye(count) + 1e-300
    alone = np.linalg.solve(curvature + ridge, pull[..., np.newaxis])[..., 0]
    taken = (alone * pull).sum(axis=2)
    places = taken.argmax(axis=0)
    every = np.arange(len(places))
    tried: list[_Common] = []
    for w in np.argsort(-taken[places, every])[:LEADERS]:
        force, found = alone[places[w], w], places
        for _ in range(ROUNDS):
            gains = 2 * pull @ force - np.einsum("d,awde,e->aw", force, curvature, force, optimize=True)
            found = gains.argmax(axis=0)
            force = np.linalg.solve(curvature[found, every].sum(axis=0) + ridge, pull[found, every].sum(axis=0))
        tried.append(_Common(float(pull[found, every].sum(axis=0) @ force), found, force))
    return max(tried, key=lambda one: one.gain)


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
    ridge = RIDGE * float(np.diagonal(curvature.sum(axis=0)).max()) + 1e-300
    part = curvature[:, lowest[:, np.newaxis], lowest] + ridge * np.eye(len(lowest))
    own = np.linalg.solve(part, gradient[:, lowest, np.newaxis])[..., 0]
    gain = np.sqrt(np.maximum(np.einsum("wi,wi->w", own, gradient[:, lowest]), 0.0))
    size_of = np.maximum(np.linalg.norm(own, axis=1), 1e-300)
    # s sin θ + c cos θ is the real part of (c − i s) exp(i θ)
    pointers = (own[:, 1::2] - 1j * own[:, ::2]) * (gain / size_of)[:, np.newaxis]
    phases = np.angle(np.linalg.svd(pointers, full_matrices=False)[0][:, 0])
    angles = np.linspace(-np.pi, np.pi, PHASES, endpoint=False)
    every = rotations(angles, harmonics, size)
    weights = np.zeros(size)
    for _ in range(ROUNDS):
        turns = rotations(phases, harmonics, size)
        back = np.swapaxes(turns, 1, 2)
        total = (back @ curvature @ turns).sum(axis=0) + ridge * np.eye(size)
        weights = np.linalg.solve(total, (back @ gradient[..., np.newaxis]).sum(axis=0))[:, 0]
        pointed = every @ weights
        gains = 2 * gradient @ pointed.T - ((pointed @ curvature) * pointed).sum(axis=2)
        phases = angles[np.argmax(gains, axis=1)]
    return phases, weights
