"""First-order influence on a fit of what one window has of its own, all else being adapted.

Its z: what each encoder reads beyond the cable's length (n), by how much all markers are shifted (3), m, and what the
body has beyond the shared one (9, `Body.vector`, m and m²). The window's own unknowns and the shared parameters with
their priors are eliminated, as in a score test.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from fidim_lab.identification.mle.fit import Fit
from fidim_lab.identification.mle.trajectories.likelihood import WindowLinear, linearised
from fidim_lab.mismatch.scores.score import eliminated
from fidim_lab.model.sensitivity.equations import BODY

AXES = 3


@dataclass(frozen=True, eq=False)
class Influence:
    """The sum of squares near z = 0: left − 2 gradientᵀ z + zᵀ information z."""

    windows: tuple[str, ...]
    cables: int
    information: Float[np.ndarray, "z z"]
    """z window after window: lengths (n), then x, y, z of the cameras, then the body"""
    gradient: Float[np.ndarray, " z"]
    left: float
    dof: int

    @property
    def width(self) -> int:
        """Entries of one window."""
        return width_of(self.cables)

    def temper(self, z: Float[np.ndarray, " z"]) -> float:
        """χ²/dof with this z, at least 1: times that the noise counts."""
        left = self.left - 2 * self.gradient @ z + z @ self.information @ z
        return max(1.0, float(left) / self.dof)


def width_of(cables: int) -> int:
    """Entries of one window's z."""
    return cables + AXES + BODY


def influence(found: Fit) -> Influence:
    """Of the windows that were fitted."""
    likelihood, values = found.likelihood, found.values
    width, shared = width_of(likelihood.mechanism.n), len(values)
    count = len(likelihood.recordings)
    gram = np.zeros((shared + count * width + 1,) * 2)
    for window in linearised(likelihood, found.journey.optimum.simulation):
        basis = np.linalg.qr(window.by_own)[0]
        ours = np.column_stack([window.by_shared, _by_own_z(found, window), window.residual])
        ours -= basis @ (basis.T @ ours)
        first = shared + window.window * width
        place = np.concatenate([np.arange(shared), first + np.arange(width), [len(gram) - 1]])
        gram[np.ix_(place, place)] += ours.T @ ours
    prior = np.zeros((len(found.prior.rows(values)), len(gram)))
    prior[:, [*range(shared), len(gram) - 1]] = found.prior.rows(values)
    gram += prior.T @ prior
    rest = eliminated(gram, np.arange(shared), np.arange(shared, len(gram)))
    ids = tuple(recording.window.id for recording in likelihood.recordings)
    dof = sum(remainder.dof for remainder in found.remainders)
    return Influence(ids, likelihood.mechanism.n, rest[:-1, :-1], -rest[:-1, -1], float(rest[-1, -1]), dof)


def _by_own_z(found: Fit, window: WindowLinear) -> Float[np.ndarray, "rows width"]:
    """Derivatives of one window's residual, predicted less recorded, by its z."""
    likelihood, simulation = found.likelihood, found.journey.optimum.simulation
    recording = likelihood.recordings[window.window]
    _, seen = recording.seen_until(float(simulation.ends[window.window]))
    axis = np.flatnonzero(seen) % AXES
    known = np.flatnonzero(np.isfinite(recording.lengths))
    n = likelihood.mechanism.n
    by = np.zeros((len(window.residual), width_of(n)))
    by[: len(axis), n : n + AXES] = likelihood.whitened(window.window, np.eye(AXES)[axis], seen)
    by[len(axis) + np.arange(len(known)), known] = 1 / likelihood.resolution
    by[:, n + AXES :] = window.by_shared[:, :BODY]
    return by
