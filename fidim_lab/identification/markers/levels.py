"""A marker displaced by steps: which part of a window is kept, since only one of its places is the true one."""

from collections.abc import Mapping
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float

from fidim_lab.arrays import Series
from fidim_lab.identification.markers.thresholds import MARKERS


def displaced_rows(
    t: Series,
    seen: Bool[np.ndarray, " N"],
    steps: Mapping[int, Float[np.ndarray, "3"]],
    same: float | Float[np.ndarray, "3"],
) -> Bool[np.ndarray, " N"]:
    """Rows to be taken out, after steps (first row → by how much, m) that may add up or cancel.

    What is where the marker was at first is kept, unless less than `levels_enough` seconds of samples that are `seen`,
    or half of the window, are there; then the place where it was longest. same: m of a coordinate, within which two
    places are one.
    """
    if not steps:
        return np.zeros(len(t), dtype=bool)
    edges = [0, *sorted(steps), len(t)]
    places = np.concatenate([np.zeros((1, 3)), np.cumsum([steps[row] for row in edges[1:-1]], axis=0)])
    alike = np.asarray((np.abs(places[:, np.newaxis] - places) <= same).all(axis=2))
    duration = float(t[-1] - t[0])
    seconds = duration / max(1, np.count_nonzero(seen))
    lasted = alike @ np.array([seconds * np.count_nonzero(seen[begin:end]) for begin, end in pairwise(edges)])
    kept = alike[0] if lasted[0] >= min(MARKERS.levels_enough, duration / 2) else alike[int(np.argmax(lasted))]
    found = np.zeros(len(t), dtype=bool)
    for (begin, end), keeps in zip(pairwise(edges), kept, strict=True):
        found[begin:end] = not keeps
    return found
