"""The limits of Eq. 42 at all times, with derivatives: tensions, displacement, conditioning of the free coordinates.

The extreme in each half second of each cable's tension (and of each free coordinate) is a limit of its own: the active
ones are linearised together, where one largest value of all would hide that another peak follows it closely.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from fidim_lab.identification.design.motions import Motions, Sensitive
from fidim_lab.model.mechanism import Mechanism

KINDS = ("tension too low", "tension too high", "displacement", "conditioning")
PIECE = 0.5
"""s"""


@dataclass(frozen=True, eq=False)
class LimitExcess:
    """How far windows exceed their limits: met where at most 0."""

    values: Float[np.ndarray, "W K"]
    """in parts of the span that is allowed (of the conditioning: of its logarithm)"""
    by: Float[np.ndarray, "W K z"]

    @property
    def worst(self) -> Float[np.ndarray, " W"]:
        """Of each window."""
        return self.values.max(axis=1)


def worst_of_kinds(motions: Motions) -> Float[np.ndarray, "W 4"]:
    """The worst of each of KINDS in each window; NaN where a motion breaks down."""
    return np.stack([values.max(axis=(1, 2)) for values in _beyond(motions)], axis=1)


def linearised(mechanism: Mechanism, sensitive: Sensitive) -> LimitExcess:
    """The worst of each half second, cable and side, with its derivative by the window's own z."""
    motions = sensitive.motions
    low, high, moved, bad = _beyond(motions)
    pieces = _pieces(motions)
    parts = [
        _tension(mechanism, sensitive, low, -1.0, pieces),
        _tension(mechanism, sensitive, high, 1.0, pieces),
        _displacement(sensitive, moved, pieces),
        _conditioning(mechanism, sensitive, bad, pieces),
    ]
    return LimitExcess(*(np.concatenate(columns, axis=1) for columns in zip(*parts, strict=True)))


def _beyond(motions: Motions) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """(W N k) for each kind: tension below and above of each cable, each side of each free coordinate, conditioning."""
    robot = motions.task.robot
    least, most = robot.limits.tension
    bounds = np.array(robot.limits.free_displacement[: len(motions.task.axes)])
    moved = motions.displacements / bounds
    s = _singular_values(motions.dependent)
    with np.errstate(divide="ignore"):
        bad = np.log(s[..., :1] / s[..., -1:]) / np.log(motions.task.conditioning)
    span = _span(motions)
    sides = np.concatenate([moved, -moved], axis=2)
    return (least - motions.tensions) / span, (motions.tensions - most) / span, sides - 1.0, bad - 1.0


def _span(motions: Motions) -> float:
    least, most = motions.task.robot.limits.tension
    return most - least


def _pieces(motions: Motions) -> list[np.ndarray]:
    """Indices of the nodes of each half second."""
    t = motions.trajectories.grid.t
    return np.split(np.arange(len(t)), np.searchsorted(t, np.arange(PIECE, t[-1] - 1e-9, PIECE)))


def _extremes(values: Float[np.ndarray, "W N k"], pieces: list[np.ndarray]) -> Int[np.ndarray, "W pieces k"]:
    """The node of the largest value in each piece."""
    return np.stack([nodes[values[:, nodes].argmax(axis=1)] for nodes in pieces], axis=1)


def _tension(
    mechanism: Mechanism,
    sensitive: Sensitive,
    beyond: Float[np.ndarray, "W N n"],
    side: float,
    pieces: list[np.ndarray],
) -> tuple[np.ndarray, np.ndarray]:
    at = _extremes(beyond, pieces)
    count, n = len(beyond), beyond.shape[2]
    each = np.broadcast_to(np.eye(n), (count, len(pieces), n, n)).reshape(count, -1, n)
    nodes = at.reshape(count, -1)
    by = sensitive.at_nodes(mechanism, nodes, sensitive.weighted(tensions=each))
    return np.take_along_axis(beyond, at, axis=1).reshape(count, -1), side * by / _span(sensitive.motions)


def _displacement(
    sensitive: Sensitive, beyond: Float[np.ndarray, "W N sides"], pieces: list[np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    task = sensitive.motions.task
    bounds = np.array(task.robot.limits.free_displacement[: len(task.axes)])
    by = sensitive.displacements_by() / bounds[:, np.newaxis]
    at, count = _extremes(beyond, pieces), len(beyond)
    slopes = np.take_along_axis(np.concatenate([by, -by], axis=2), at[..., np.newaxis], axis=1)
    return np.take_along_axis(beyond, at, axis=1).reshape(count, -1), slopes.reshape(count, -1, task.width)


def _conditioning(
    mechanism: Mechanism, sensitive: Sensitive, bad: Float[np.ndarray, "W N 1"], pieces: list[np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Of the largest and smallest singular value of Ξ_d: u₁ᵀ dΞ_d v₁/s₁ − uₙᵀ dΞ_d vₙ/sₙ."""
    motions = sensitive.motions
    at = _extremes(bad, pieces)[..., 0]
    worst = np.take_along_axis(motions.dependent, at[..., np.newaxis, np.newaxis], axis=1)
    U, s, Vt = np.linalg.svd(worst)
    scale = np.log(motions.task.conditioning)
    slope = U[..., :, :1] @ Vt[..., :1, :] / s[..., :1, np.newaxis]
    slope = (slope - U[..., :, -1:] @ Vt[..., -1:, :] / s[..., -1:, np.newaxis]) / scale
    by = sensitive.at_nodes(mechanism, at, sensitive.weighted(dependent=slope))
    return np.take_along_axis(bad[..., 0], at, axis=1), by


def _singular_values(matrices: Float[np.ndarray, "W N n n"]) -> Float[np.ndarray, "W N n"]:
    """NaN where a matrix has NaN: LAPACK would refuse them all."""
    whole: np.ndarray = np.isfinite(matrices).min(axis=(-2, -1))[..., np.newaxis]
    values = np.linalg.svd(np.where(whole[..., np.newaxis], matrices, 0.0), compute_uv=False)
    return np.where(whole, values, np.nan)
