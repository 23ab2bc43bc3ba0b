"""Frames that were lost while the time stamps went on: all coordinates step along their velocity.

The number of frames that makes the motion smooth again tells them from a step of one marker (`displaced`).
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from jaxtyping import Float

from fidim_lab.identification.markers.thresholds import MARKERS


@dataclass(frozen=True)
class LostFrames:
    """Between rows `at` − 1 and `at` so many frames are missing, unseen by the time stamps."""

    at: int
    frames: int


def lost_frames(columns: Float[np.ndarray, "G K"], sigma: Float[np.ndarray, " K"], near: int) -> LostFrames | None:
    """How many frames are lost within ±2 rows of `near`, if that number makes all coordinates smooth; else None."""
    places = [
        at
        for at in range(near - 2, near + 3)
        if MARKERS.lost_frames_side <= at <= len(columns) - MARKERS.lost_frames_side
    ]
    pieces = [columns[at - MARKERS.lost_frames_side : at + MARKERS.lost_frames_side] / sigma for at in places]
    whole = [(at, piece) for at, piece in zip(places, pieces, strict=True) if np.isfinite(piece).all()]
    if not whole:
        return None
    dof = (2 * MARKERS.lost_frames_side - MARKERS.lost_frames_smooth - 1) * columns.shape[1]
    stacked = np.stack([piece for _, piece in whole])
    costs = _projectors()[:, np.newaxis] @ stacked
    chi2_per_dof = (costs**2).sum(axis=(2, 3)) / dof
    frames, place = (int(k) for k in np.unravel_index(int(np.argmin(chi2_per_dof)), chi2_per_dof.shape))
    at = whole[place][0]
    otherwise = _displaced_projectors()[:, np.newaxis] @ stacked
    as_displaced = float((otherwise**2).sum(axis=(2, 3)).min()) / (dof - columns.shape[1])
    if frames == 0 or chi2_per_dof[frames, place] > min(MARKERS.lost_frames_fits, MARKERS.plainer * as_displaced):
        return None
    return LostFrames(at, frames)


@cache
def _projectors() -> Float[np.ndarray, "F 20 20"]:
    """What a polynomial leaves of 2 MARKERS.lost_frames_side samples with 0, 1, 2 … frames lost in their middle."""
    return np.stack(
        [
            _left_by(
                np.arange(2 * MARKERS.lost_frames_side)
                + frames * (np.arange(2 * MARKERS.lost_frames_side) >= MARKERS.lost_frames_side)
            )
            for frames in range(MARKERS.most_lost + 1)
        ]
    )


@cache
def _displaced_projectors() -> Float[np.ndarray, "A 20 20"]:
    """The same without lost frames, but with a step in the middle, or one sample displaced on either side of it."""
    rows = np.arange(2 * MARKERS.lost_frames_side)
    others = (rows >= MARKERS.lost_frames_side, rows == MARKERS.lost_frames_side, rows == MARKERS.lost_frames_side - 1)
    return np.stack([_left_by(rows, other.astype(float)) for other in others])


def _left_by(place: np.ndarray, *further: np.ndarray) -> np.ndarray:
    scaled = 2 * (place - place[0]) / (place[-1] - place[0]) - 1
    basis = np.column_stack([np.polynomial.legendre.legvander(scaled, MARKERS.lost_frames_smooth), *further])
    orthonormal = np.linalg.qr(basis)[0]
    return np.eye(len(place)) - orthonormal @ orthonormal.T
