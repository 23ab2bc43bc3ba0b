"""Names for the array shapes of this project: N samples, n cables, λ = 6 − n freedoms; and `runs` of a mask.

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
