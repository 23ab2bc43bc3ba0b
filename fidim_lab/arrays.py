"""Names for array shapes: N samples, n cables, λ = 6 − n freedoms; `runs` of a mask, means of what is seen, `skew`.

jaxtyping annotations; they are checked at run time only under pytest.
"""

import numpy as np
from jaxtyping import Bool, Float

Vector3 = Float[np.ndarray, "3"]
Matrix3 = Float[np.ndarray, "3 3"]
Inertia6 = Float[np.ndarray, "6"]
"""xx yy zz xy xz yz"""

Positions = Float[np.ndarray, "N 3"]
Rotations = Float[np.ndarray, "N 3 3"]
Twists = Float[np.ndarray, "N 6"]
"""[ṗ; ω] in the world frame"""

PerCable = Float[np.ndarray, "n"]
CableSeries = Float[np.ndarray, "N n"]
Series = Float[np.ndarray, "N"]
Mask = Bool[np.ndarray, "N"]


def runs(mask: Mask) -> list[tuple[int, int]]:
    """Begin and end (exclusive) of every run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(int), [0]])))
    return [(int(begin), int(end)) for begin, end in zip(edges[::2], edges[1::2], strict=True)]


def mean_of_seen(values: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    """Mean along the first axis of what is finite; NaN where nothing is."""
    seen = np.isfinite(values)
    count = seen.sum(axis=0)
    return np.where(count > 0, np.where(seen, values, 0.0).sum(axis=0) / np.maximum(count, 1), np.nan)


def motion_rms(values: Float[np.ndarray, "..."]) -> float:
    """rms of all columns about their means, in their unit, of what is finite; NaN where nothing is."""
    away = values - mean_of_seen(values)
    seen = np.isfinite(away)
    return float(np.sqrt(np.mean(away[seen] ** 2))) if seen.any() else np.nan


def skew(vectors: Float[np.ndarray, "... 3"]) -> Float[np.ndarray, "... 3 3"]:
    """[x]× of each."""
    matrices = np.zeros((*vectors.shape, 3))
    x, y, z = np.moveaxis(vectors, -1, 0)
    matrices[..., 0, 1], matrices[..., 0, 2], matrices[..., 1, 2] = -z, y, -x
    matrices[..., 1, 0], matrices[..., 2, 0], matrices[..., 2, 1] = z, -y, x
    return matrices
