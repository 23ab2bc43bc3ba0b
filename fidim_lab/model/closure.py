"""What cable lengths and markers say of the same motion twice, whatever the platform's dynamics are.

A small motion of the platform (three translations, three rotations) changes n lengths and 3M marker coordinates. More
than six of them are not independent: there are combinations with P δm = L δl for every motion. A signal of the encoders
(L l) and one of motion capture (P m) then show the same thing, and differ in time alone.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from fidim_lab.arrays import PerCable
from fidim_lab.data.records import Pose
from fidim_lab.model.geometry import rotation_matrix
from fidim_lab.model.mechanism import Mechanism

_STEP = 1e-5
"""m and rad, of central differences"""
_RANK = 1e-6
"""of a singular value to the largest: below is a combination that no motion changes"""


@dataclass(frozen=True, eq=False)
class Closure:
    """P δm = L δl for every small motion about a pose; the rows of P are orthonormal, k may be 0."""

    of_lengths: Float[np.ndarray, "k n"]
    """L"""
    of_markers: Float[np.ndarray, "k 3M"]
    """P"""

    def seen_by(self, change: PerCable) -> "Closure":
        """The one combination that a change of lengths (n,) moves most; none where it moves none."""
        if not len(self.of_lengths):
            return self
        moved = self.of_lengths @ change
        size = float(np.linalg.norm(moved))
        if size == 0.0:
            return Closure(self.of_lengths[:0], self.of_markers[:0])
        direction = (moved / size)[None]
        return Closure(direction @ self.of_lengths, direction @ self.of_markers)


def closure_at(mechanism: Mechanism, pose: Pose, markers: Float[np.ndarray, "M 3"]) -> Closure:
    """The combinations at a pose; markers: body frame, m. Raises InfeasibleError for a pose without cable lengths."""
    steps = _STEP * np.concatenate([np.eye(6), -np.eye(6)])
    positions = pose.position + steps[:, :3]
    rotations = np.array([rotation_matrix(turn) @ pose.rotation for turn in steps[:, 3:]])
    lengths = mechanism.lengths(positions, rotations)
    places = positions[:, None] + np.einsum("kij,mj->kmi", rotations, markers)
    both = np.hstack([lengths, places.reshape(12, -1)])
    jacobian = ((both[:6] - both[6:]) / (2.0 * _STEP)).T  # (n + 3M, 6)
    left, values, _ = np.linalg.svd(jacobian)
    rank = int((values > _RANK * values[0]).sum())
    null = left[:, rank:].T
    n = lengths.shape[1]
    # Markers alone may be redundant among themselves (three or more): what has no part of lengths says nothing here.
    turn, parts, _ = np.linalg.svd(null[:, :n], full_matrices=False)
    mixed = turn[:, parts > _RANK].T @ null
    of_lengths, of_markers = -mixed[:, :n], mixed[:, n:]
    return _orthonormal(of_lengths, of_markers)


def _orthonormal(of_lengths: np.ndarray, of_markers: np.ndarray) -> Closure:
    """Rows of P made orthonormal, so that marker noise is the same in each; what holds of lengths alone is left out."""
    turn, parts, _ = np.linalg.svd(of_markers, full_matrices=False)
    seen = parts > _RANK
    scale = turn[:, seen].T / parts[seen, None]
    return Closure(scale @ of_lengths, scale @ of_markers)
