"""Windows cut into short segments, each with a start of its own: where in a window is the motion not free?

The body is shared by all segments, so a force that acts everywhere raises the χ² of all of them, smoothly from one to
the next; a hand, or a sensor that stumbles, raises one or two and leaves their neighbours alone. Two seconds are
long enough to feel a fifth of a newton on ten kilograms and too short for any phase to slip.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float

from fidim_lab.arrays import motion_rms
from fidim_lab.data.records import Window
from fidim_lab.identification.mle.fit import Fit, fit
from fidim_lab.identification.mle.judge import Remainder
from fidim_lab.mismatch.cleaning.thresholds import CLEANING
from fidim_lab.mismatch.fitting.holdout import predictions
from fidim_lab.mismatch.fitting.refit import Completed
from fidim_lab.mismatch.residuals.residual import Leftover, of_remainder
from fidim_lab.model.mechanism import Mechanism


@dataclass(frozen=True, eq=False)
class Segmented:
    """One window's segments, in order."""

    window: Window
    edges: Float[np.ndarray, " edges"]
    """s on the window's own clock"""
    chi2_per_dof: Float[np.ndarray, " K"]
    """NaN where a segment could not be used"""
    dof: Float[np.ndarray, " K"]

    @property
    def level(self) -> float:
        """χ²/dof of a usual segment of this window."""
        return float(np.nanquantile(self.chi2_per_dof, 0.4)) if np.isfinite(self.chi2_per_dof).any() else np.nan

    @property
    def liveliness(self) -> Float[np.ndarray, " K"]:
        """How far the markers swing in each segment, rms m; NaN where none is seen."""
        found = np.full(len(self.chi2_per_dof), np.nan)
        for k, (begin, end) in enumerate(pairwise(self.edges)):
            markers = self.window.markers[(self.window.t >= begin) & (self.window.t < end)]
            found[k] = motion_rms(markers)
        return found


@dataclass(frozen=True, eq=False)
class Segments:
    """All windows' segments, and the fit of the body to them, or the one by which they are predicted."""

    windows: tuple[Segmented, ...]
    fit: Fit

    @property
    def leftovers(self) -> tuple[Leftover, ...]:
        """The residual of each segment, by its window's id."""
        likelihood = self.fit.likelihood
        ids = {_name(one.window, k): one.window.id for one in self.windows for k in range(len(one.dof))}
        pairs = zip(likelihood.recordings, self.fit.remainders, strict=True)
        return tuple(of_remainder(ids[recording.window.id], left, likelihood) for recording, left in pairs)


def fit_segments(
    mechanism: Mechanism, windows: Sequence[Window], length: float = CLEANING.segment, *, hasty: bool = False
) -> Segments:
    """Fit body and segments' starts; hasty: as `fit`. Raises RefusedError where no segment can be used."""
    cut = _cut(windows, length)
    found = fit(mechanism, cut.pieces, hasty=hasty)
    ids = [recording.window.id for recording in found.likelihood.recordings]
    return Segments(cut.segmented(dict(zip(ids, found.remainders, strict=True))), found)


def predict_segments(model: Completed, windows: Sequence[Window], length: float = CLEANING.segment) -> Segments:
    """Fit segments' starts alone, by a model with its body and effects: none need be followed for long."""
    cut = _cut(windows, length)
    found = predictions(model.fit, cut.pieces).found
    return Segments(cut.segmented({window.id: one.remainder for window, one in found}), model.fit)


@dataclass(frozen=True, eq=False)
class _Cut:
    """Windows with the edges of their segments, and the segments that can be used."""

    windows: tuple[tuple[Window, Float[np.ndarray, " edges"]], ...]
    pieces: tuple[Window, ...]

    def segmented(self, left: Mapping[str, Remainder]) -> tuple[Segmented, ...]:
        """With what is left of each segment, by its name."""
        found: list[Segmented] = []
        for window, edges in self.windows:
            ours = [left.get(_name(window, k)) for k in range(len(edges) - 1)]
            chi2 = np.array([np.nan if one is None else one.chi2_per_dof for one in ours])
            dof = np.array([np.nan if one is None else float(one.dof) for one in ours])
            found.append(Segmented(window, edges, chi2, dof))
        return tuple(found)


def _cut(windows: Sequence[Window], length: float) -> _Cut:
    cut = tuple((window, edges_of(window, length)) for window in windows)
    pieces = [piece(window, edges, k) for window, edges in cut for k in range(len(edges) - 1)]
    return _Cut(cut, tuple(one for one in pieces if one is not None))


def edges_of(window: Window, length: float) -> Float[np.ndarray, " edges"]:
    """Begins and ends of a window's segments, all of about this length (s)."""
    seen = np.flatnonzero(np.isfinite(window.markers).any(axis=(1, 2)))
    first, last = (0, len(window.t) - 1) if not len(seen) else (int(seen[0]), int(seen[-1]))
    count = max(1, round(float(window.t[last] - window.t[first]) / length))
    return np.linspace(window.t[first], window.t[last], count + 1)


def piece(window: Window, edges: Float[np.ndarray, " edges"], k: int) -> Window | None:
    """Segment k as a window with the lengths of the whole; None where it holds too few samples."""
    use = (window.t >= edges[k]) & (window.t < edges[k + 1])
    return part(window, use, _name(window, k))


def part(window: Window, use: Bool[np.ndarray, " N"], name: str) -> Window | None:
    """Some rows of a window, with the lengths of the whole: what the motors hold does not change."""
    if np.isfinite(window.markers[use]).all(axis=2).any(axis=-1).sum() < CLEANING.segments_fewest:
        return None
    return replace(
        window,
        id=name,
        t=window.t[use],
        markers=window.markers[use],
        lengths=None if window.lengths is None else _held(window.lengths, int(use.sum())),
        currents=None,
        further={},
    )


def _held(lengths: np.ndarray, rows: int) -> np.ndarray:
    known = np.isfinite(lengths).any(axis=0)
    held = np.full(lengths.shape[1], np.nan)
    held[known] = np.nanmean(lengths[:, known], axis=0)
    return np.tile(held, (rows, 1))


def _name(window: Window, k: int) -> str:
    return f"{window.id} segment {k + 1}"
