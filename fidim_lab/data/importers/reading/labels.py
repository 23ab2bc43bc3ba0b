"""Which columns of an export are labelled markers, and which were seen and given to none."""

from collections.abc import Sequence

import numpy as np

LOOSE = ("*", "unlabel", "uname")
"""begin such a name, in small letters, in Vicon's, OptiTrack's and others' exports"""


def is_loose(name: str) -> bool:
    """Whether it is the name of an unlabelled trajectory; `subject:*3` too."""
    return name.rpartition(":")[2].strip().lower().startswith(LOOSE)


def apart(names: Sequence[str], positions: np.ndarray) -> tuple[tuple[str, ...], np.ndarray, np.ndarray | None]:
    """Labelled names, their (N, M, 3) places, and the (N, K, 3) places without a label; all of them if none has one.

    A name that stands there again labels nothing: which of its places is which, the rigid distances tell.
    """
    loose = [k for k, name in enumerate(names) if is_loose(name) or name in names[:k]]
    if not loose or len(loose) == len(names):
        return tuple(names), positions, None
    kept = [k for k in range(len(names)) if k not in set(loose)]
    return tuple(names[k] for k in kept), positions[:, kept], positions[:, loose]
