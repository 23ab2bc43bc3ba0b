"""Samples that motion capture filled in where it saw nothing: zeros, one value for "not seen", and held places."""

import numpy as np

from fidim_lab.arrays import runs

SENTINELS = (-9999.0, -999.0, 9999.0, 999.0, 99999.0, 9999999.0, -9999999.0)
"""in the file's own unit, in all three coordinates: one of them may well be 999 mm"""
NOWHERE = 1e9
"""in the file's own unit, beyond which nothing stands: what a damaged cell says. Squares of it are still numbers"""
FEWEST_HELD = 10
"""equal places in a row: measured ones differ in the last digit"""


def without_filled(positions: np.ndarray, scale: float) -> tuple[np.ndarray, tuple[str, ...]]:
    """NaN for what was not measured, and what was found, a sentence each.

    positions: (N, M, 3) m; scale: metres in one unit of the file.
    """
    marks = {
        "at exactly 0, 0, 0": np.asarray(positions == 0.0).all(axis=2),
        "with a value that stands for not seen": _all_sentinels(positions / scale),
        "with a value that is not a position": np.asarray(np.abs(positions / scale) > NOWHERE).any(axis=2),
        f"that did not change for {FEWEST_HELD} samples or more": _held(positions),
    }
    said = tuple(f"{int(mark.sum())} samples {words} count as not seen" for words, mark in marks.items() if mark.any())
    found = positions.copy()
    found[np.any(list(marks.values()), axis=0)] = np.nan
    return found, said


def _all_sentinels(values: np.ndarray) -> np.ndarray:
    """(N, M) where all three coordinates are one of `SENTINELS`."""
    marked = np.zeros(values.shape[:2], dtype=bool)
    for sentinel in SENTINELS:
        marked |= np.isclose(values, sentinel).all(axis=2)
    return marked


def _held(positions: np.ndarray) -> np.ndarray:
    """(N, M) where a marker has the very same place in `FEWEST_HELD` samples in a row, all but the first of them."""
    same = np.zeros(positions.shape[:2], dtype=bool)
    same[1:] = (np.diff(positions, axis=0) == 0.0).all(axis=2)
    held = np.zeros_like(same)
    for marker in range(positions.shape[1]):
        for begin, end in runs(same[:, marker]):
            held[begin:end, marker] = end - begin + 1 >= FEWEST_HELD
    return held
