"""Breaks in residuals: samples, and steps from one sample on, that no motion makes, however small.

`displaced` looks at markers as recorded, which are smooth for a tenth of a second only; what a fit leaves of them is
smooth for half a second, even where physics is missing, so that steps of five standard deviations show in it, and
those behind a gap. The scale is chosen place by place: the longest at which the neighbours follow a polynomial. Where
they follow none (a knock, a ringing cable) nothing is said. What stands out is judged by `break_rivals`.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from numpy.lib.stride_tricks import sliding_window_view
from scipy.ndimage import maximum_filter1d

from fidim_lab.identification.markers.displaced import ScoreLimits
from fidim_lab.identification.markers.neighbours import noise_of
from fidim_lab.identification.markers.thresholds import MARKERS
from fidim_lab.mismatch.residuals.break_rivals import Break, judge
from fidim_lab.mismatch.residuals.thresholds import RESIDUALS
from fidim_lab.mismatch.thresholds import SHARED

NOWHERE = slice(0, 0)


@dataclass(frozen=True, eq=False)
class Breaks:
    """The finding in one marker's samples."""

    spikes: tuple[int, ...]
    """rows"""
    steps: tuple[tuple[int, Float[np.ndarray, "3"]], ...]
    """first rows, and by how much everything from there on is displaced, in standard deviations of the noise"""


def breaks_of(
    values: Float[np.ndarray, "G 3"],
    step: float,
    limits: ScoreLimits,
    *,
    clearer: float = MARKERS.rivals_clearer,
    spikes: ScoreLimits | None = None,
    jumps: slice | None = None,
) -> Breaks:
    """Breaks in one marker's whitened residual on an even grid of `step` seconds (NaN: missing).

    limits: how far beyond chance something must stand. clearer: by how much a fault must be preferred to motion.
    spikes: how far single samples must stand, of a marker known to have many that are off. jumps: of one that is known
    to jump, the rows (there may be none) among which the most telling is judged however little it stands out.
    """
    sigma = np.maximum(np.nan_to_num(noise_of(values), nan=1.0), 1.0)
    work = values / sigma
    alone: list[int] = []
    steps: dict[int, np.ndarray] = {}
    looked: set[int] = set()
    expected = jumps or NOWHERE
    for _ in range(RESIDUALS.breaks_rounds):
        peaks = [row for row in _peaks(work, step, limits, spikes or limits, expected) if row not in looked]
        behind = [row for row in _after_gaps(work) if row not in looked and row not in peaks]
        if not peaks and not behind:
            break
        for row in (*peaks, *behind):
            needed = max(clearer, RESIDUALS.breaks_plain) if row in behind and jumps is None else clearer
            found = judge(work, step, row, clearer=needed, spiking=spikes is not None, jumps=jumps is not None)
            looked.update((row,) if found.what is Break.SPIKES else range(row - 2, row + 3))
            if found.what is Break.SPIKES:
                alone += found.rows
                work[list(found.rows)] = np.nan
            elif found.what is Break.STEP and found.amplitude is not None:
                first = found.rows[0]
                steps[first] = steps.get(first, np.zeros(3)) + found.amplitude * sigma
                work[first:] -= found.amplitude
    return Breaks(tuple(sorted(alone)), tuple(sorted(steps.items(), key=lambda one: one[0])))


def _peaks(
    work: Float[np.ndarray, "G 3"], step: float, limits: ScoreLimits, spikes: ScoreLimits, expected: slice
) -> Sequence[int]:
    """Rows that stand out most among their neighbours, and the first of those expected, the most telling first."""
    strength = np.zeros(len(work))
    undecided = np.ones(len(work), dtype=bool)
    for reach, degree in RESIDUALS.breaks_scales:
        scan = _scan(work, max(RESIDUALS.breaks_fewest, round(reach / step)), degree)
        calm = undecided & scan.calm(max(RESIDUALS.breaks_samples, round(RESIDUALS.breaks_around / step)))
        strength[calm] = scan.strength(limits, spikes)[calm]
        undecided &= ~calm
        if not undecided.any():
            break
    standing = (strength > 1) & (strength == maximum_filter1d(strength, 2 * RESIDUALS.breaks_fewest + 1))
    if strength[expected].any():
        standing[expected.start + np.argmax(strength[expected])] = True
    rows = np.flatnonzero(standing)
    return [int(row) for row in rows[np.argsort(-strength[rows])]]


def _after_gaps(work: Float[np.ndarray, "G 3"]) -> list[int]:
    """First rows after gaps."""
    seen = np.flatnonzero(np.isfinite(work).all(axis=1))
    return [int(seen[k + 1]) for k in np.flatnonzero(np.diff(seen) > RESIDUALS.breaks_gap)]


@dataclass(frozen=True, eq=False)
class _Scan:
    """z-scores of every row (G) as a spike or as the first after a step, each coordinate; NaN where unknown."""

    spike: Float[np.ndarray, "G 3"]
    step: Float[np.ndarray, "G 3"]

    def calm(self, around: int) -> Bool[np.ndarray, " G"]:
        """Where the neighbours follow their polynomials."""
        size = (
            np.concatenate([np.abs(self.spike) / SHARED.noise, np.abs(self.step) / RESIDUALS.breaks_level], axis=1)
            / MARKERS.neighbours_mad
        )
        rows = np.flatnonzero(np.isfinite(size).all(axis=1))
        if len(rows) < RESIDUALS.breaks_fewest:
            return np.zeros(len(size), dtype=bool)
        blocks = np.array_split(rows, max(1, len(rows) // around))
        scatter = [np.median(size[block], axis=0).max() for block in blocks]
        return np.interp(np.arange(len(size)), [block.mean() for block in blocks], scatter) < 1

    def strength(self, limits: ScoreLimits, spikes: ScoreLimits) -> Float[np.ndarray, " G"]:
        """How far beyond chance."""
        return np.maximum(_strength(self.spike, spikes), _strength(self.step, limits))


def _strength(scores: Float[np.ndarray, "G 3"], limits: ScoreLimits) -> Float[np.ndarray, " G"]:
    z = np.nan_to_num(scores)
    return np.maximum(np.abs(z).max(axis=1) / limits.single, np.linalg.norm(z, axis=1) / limits.joint)


def _scan(work: Float[np.ndarray, "G 3"], half: int, degree: int) -> _Scan:
    """Every row against a polynomial through its neighbours that are there."""
    width = 2 * half + 1
    seen = np.asarray(np.isfinite(work).all(axis=1))
    basis = np.polynomial.legendre.legvander(np.arange(-half, half + 1) / half, degree)
    masks = sliding_window_view(np.pad(seen, half).astype(float), width)
    padded = np.pad(np.where(seen[:, np.newaxis], work, 0.0), ((half, half), (0, 0)))
    values = np.ascontiguousarray(np.swapaxes(sliding_window_view(padded, width, axis=0), 1, 2))
    products = (basis[:, :, np.newaxis] * basis[:, np.newaxis]).reshape(width, -1)
    normal = (masks @ products).reshape(-1, degree + 1, degree + 1) + 1e-9 * np.eye(degree + 1)
    right = np.stack([values[..., k] @ basis for k in range(3)], axis=2)
    later = (np.arange(width) >= half).astype(float)
    wanted = np.stack([np.broadcast_to(basis[half], (len(work), degree + 1)), (masks * later) @ basis], axis=2)
    solved = np.linalg.solve(normal, wanted)
    norm2 = np.stack([seen.astype(float), masks @ later], axis=1) - np.einsum("gds,gds->gs", wanted, solved)
    here = np.stack([np.where(seen[:, np.newaxis], work, 0.0), later @ values], axis=1)
    left = here - np.einsum("gds,gdk->gsk", solved, right)
    enough = seen & (masks.sum(axis=1) >= degree + RESIDUALS.breaks_fewest)
    beside = np.minimum(masks[:, :half].sum(axis=1), masks[:, half:].sum(axis=1)) >= RESIDUALS.breaks_fewest
    usable = np.stack([enough, enough & beside], axis=1) & (norm2 > RESIDUALS.breaks_smallest_norm)
    z = left / np.sqrt(np.where(usable, norm2, np.nan))[..., np.newaxis]
    return _Scan(z[:, 0], z[:, 1])
