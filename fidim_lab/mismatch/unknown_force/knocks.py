"""A short force that is repeated, at different times in every window.

Knocks that are short beside their period have so many harmonics that these must be taken together: of a Gaussian of
width s harmonic k has the share a_k = exp(−(2π f k s)²/2). What all windows have in common is one force; it, and when
each window feels it, are found in turn, from the windows that say most by themselves.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from fidim_lab.mismatch.scores.thresholds import SCORES
from fidim_lab.mismatch.thresholds import SHARED
from fidim_lab.mismatch.unknown_force.own_times import OwnTimes, cost_of

WIDTHS = (0.02, 0.04, 0.08, 0.16)
"""s, standard deviation of a knock"""
PHASES = 48
"""angles that are tried"""


def knocks(
    grams: Float[np.ndarray, "W m m"], shared: int, directions: int, frequency: float, inflation: float
) -> OwnTimes:
    """As `own_times` for one force, and of the widths that are tried the one that takes most.

    directions: of the force, each with a constant and then sin and cos of every harmonic (of `frequency`, Hz).
    """
    weights = slice(shared, grams.shape[1] - 1)
    curvature, gradient = grams[:, weights, weights], -grams[:, weights, -1]
    train = _Train(frequency, (gradient.shape[1] // directions - 1) // 2)
    angles = np.linspace(-np.pi, np.pi, PHASES, endpoint=False)
    found = {width: _common_force(train.at(angles, width), curvature, gradient, directions) for width in WIDTHS}
    width, common = max(found.items(), key=lambda pair: pair[1].gain)
    phases, step = angles[common.places], np.pi / PHASES
    later = (train.at(phases + step, width) - train.at(phases - step, width)) / (2 * step)
    moved = np.einsum("d,wk->wdk", common.force, later).reshape(gradient.shape)
    return OwnTimes(
        _reduced(grams, shared, _spread(train.at(phases, width), directions)),
        phases,
        cost_of(moved, curvature, inflation),
        _spread(train.at(np.zeros(1), width), directions)[0],
    )


@dataclass(frozen=True)
class _Train:
    """Gaussians one period apart, by a constant and sin and cos of every harmonic; 1 at the height of each."""

    frequency: float
    """Hz"""
    harmonics: int

    def at(self, phases: Float[np.ndarray, " A"], width: float) -> Float[np.ndarray, "A K"]:
        """At each phase (rad) of time 0; width: s."""
        k = np.arange(1, self.harmonics + 1)
        shares = np.exp(-((2 * np.pi * self.frequency * k * width) ** 2) / 2)
        found = np.zeros((len(phases), 2 * self.harmonics + 1))
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


def _common_force(
    courses: Float[np.ndarray, "A K"],
    by_wave: Float[np.ndarray, "W Q Q"],
    pull_of_waves: Float[np.ndarray, "W Q"],
    directions: int,
) -> _Common:
    """The force that takes most, and when each window feels it. courses: at each phase that is tried."""
    table = by_wave.reshape(len(by_wave), directions, -1, directions, courses.shape[1])
    curvature = np.einsum("ak,wdkea->awde", courses, table @ courses.T, optimize=True)
    pull = np.einsum("ak,wdk->awd", courses, pull_of_waves.reshape(len(by_wave), directions, -1), optimize=True)
    ridge = 1e-9 * float(np.trace(curvature.sum(axis=(0, 1)))) / len(courses) * np.eye(directions) + 1e-300
    alone = np.linalg.solve(curvature + ridge, pull[..., np.newaxis])[..., 0]
    taken = (alone * pull).sum(axis=2)
    places, every = taken.argmax(axis=0), np.arange(taken.shape[1])
    tried: list[_Common] = []
    for w in np.argsort(-taken[places, every])[: SHARED.leaders]:
        force, found = alone[places[w], w], places
        for _ in range(SCORES.own_phase_rounds):
            gains = 2 * pull @ force - np.einsum("d,awde,e->aw", force, curvature, force, optimize=True)
            found = gains.argmax(axis=0)
            force = np.linalg.solve(curvature[found, every].sum(axis=0) + ridge, pull[found, every].sum(axis=0))
        tried.append(_Common(float(pull[found, every].sum(axis=0) @ force), found, force))
    return max(tried, key=lambda one: one.gain)


def _spread(courses: Float[np.ndarray, "W K"], directions: int) -> Float[np.ndarray, "W Q d"]:
    """Weights of all waves by the force."""
    return np.einsum("de,wk->wdke", np.eye(directions), courses).reshape(len(courses), -1, directions)


def _reduced(
    grams: Float[np.ndarray, "W m m"], shared: int, spread: Float[np.ndarray, "W Q d"]
) -> Float[np.ndarray, "W n n"]:
    """By [shared, force, residual] instead of all waves."""
    whole = np.zeros((len(grams), grams.shape[1], shared + spread.shape[2] + 1))
    whole[:, range(shared), range(shared)] = 1.0
    whole[:, shared:-1, shared:-1] = spread
    whole[:, -1, -1] = 1.0
    return np.swapaxes(whole, 1, 2) @ grams @ whole
