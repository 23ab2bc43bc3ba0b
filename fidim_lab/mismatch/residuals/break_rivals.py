"""What an outstanding place in a residual is: smooth, a kink, some samples off, or a step.

As `rivals`, on what a fit leaves instead of on markers as recorded, hence over more samples: each rival is fitted to
the samples on either side, counted across gaps, beside polynomials of several degrees, and the Bayesian information
criterion weighs what they explain against their freedom. A kink (a blow, which the body really felt) is nobody's
fault. Nothing is called a fault beside which the samples do not follow their polynomial.
"""

from dataclasses import dataclass
from enum import Enum
from itertools import combinations

import numpy as np
from jaxtyping import Bool, Float

from fidim_lab.identification.markers.thresholds import MARKERS
from fidim_lab.mismatch.residuals.thresholds import RESIDUALS
from fidim_lab.mismatch.thresholds import SHARED


class Break(Enum):
    """The rivals."""

    NONE = "motion"
    KINK = "a kink"
    RAMP = "a quick move"
    SPIKES = "displaced samples"
    STEP = "a step"


@dataclass(frozen=True, eq=False)
class JudgedBreak:
    """The rival that wins."""

    what: Break
    rows: tuple[int, ...] = ()
    """displaced samples, or the first after a step"""
    amplitude: Float[np.ndarray, "3"] | None = None
    """of a step, in standard deviations of the noise"""


@dataclass(frozen=True, eq=False)
class _Rival:
    what: Break
    rows: tuple[int, ...]
    design: Float[np.ndarray, "S D"]
    kept: Bool[np.ndarray, " S"]
    freedom: float
    """of each coordinate"""


def judge(
    values: Float[np.ndarray, "G 3"],
    step: float,
    row: int,
    *,
    clearer: float = MARKERS.rivals_clearer,
    spiking: bool = False,
    jumps: bool = False,
) -> JudgedBreak:
    """What stands out at `row` of whitened residuals on an even grid of `step` seconds (NaN: missing).

    clearer: by how much the criterion must prefer a fault. spiking: the marker is known to have samples off; then it
    need not prefer them clearly. jumps: it is known to jump; a faint step, or one that might be a blow or a quick
    move, is then believed.
    """
    rows = _beside(values, step, row, RESIDUALS.known_reach if jumps else RESIDUALS.break_rivals_reach)
    if rows is None:
        return JudgedBreak(Break.NONE)
    time = (rows - rows[0]) / (rows[-1] - rows[0]) * 2 - 1
    piece = values[rows]
    rivals = [one for one in _rivals(rows, time, row) if not jumps or one.what not in (Break.RAMP, Break.KINK)]
    tried = [(rival, *_cost(rival, piece)) for rival in rivals]
    best, cost, left, size = min(tried, key=lambda one: one[1])
    if best.what not in (Break.SPIKES, Break.STEP):
        return JudgedBreak(best.what)
    innocent = min(one[1] for one in tried if one[0].what in (Break.NONE, Break.KINK))
    scatter = float(np.median(np.abs(left[best.kept]))) / MARKERS.neighbours_mad
    faint = best.what is Break.STEP and not jumps and float(np.linalg.norm(size)) < RESIDUALS.break_rivals_faint
    needed = 0.0 if spiking and best.what is Break.SPIKES else clearer
    if cost + needed > innocent or scatter > SHARED.noise or faint:
        return JudgedBreak(Break.NONE)
    return JudgedBreak(best.what, best.rows, size if best.what is Break.STEP else None)


def _beside(values: Float[np.ndarray, "G 3"], step: float, row: int, reach: float) -> np.ndarray | None:
    """Rows with a sample on either side of a place; None where there are few, or none from there on."""
    seen = np.flatnonzero(np.isfinite(values).all(axis=1))
    most = int(np.clip(round(reach / step), RESIDUALS.break_rivals_fewest, RESIDUALS.break_rivals_most))
    at = int(np.searchsorted(seen, row))
    before, after = seen[max(0, at - most) : at], seen[at : at + most]
    before = before[(before[-1:] - before) * step <= RESIDUALS.break_rivals_farthest]
    after = after[(after - after[:1]) * step <= RESIDUALS.break_rivals_farthest]
    few = len(after) == 0 or len(before) + len(after) < 2 * RESIDUALS.breaks_fewest
    return None if few else np.concatenate([before, after])


def _cost(rival: _Rival, piece: Float[np.ndarray, "S 3"]) -> tuple[float, np.ndarray, np.ndarray]:
    """The criterion, what is left of all samples, and the size of the last column."""
    design, kept = rival.design, rival.kept
    found = np.linalg.lstsq(design[kept], piece[kept], rcond=None)[0]
    left = piece - design @ found
    chi2 = float((left[kept] ** 2).sum())
    return chi2 + 3 * rival.freedom * float(np.log(3 * len(piece))), left, found[-1]


def _rivals(rows: np.ndarray, time: np.ndarray, row: int) -> list[_Rival]:
    whole = np.ones(len(rows), dtype=bool)
    basis = np.polynomial.legendre.legvander(time, max(RESIDUALS.break_rivals_sharper))
    at = int(np.searchsorted(rows, row))
    found = [
        _Rival(Break.NONE, (), basis[:, : d + 1], whole, d)
        for d in (*RESIDUALS.break_rivals_degrees, *RESIDUALS.break_rivals_sharper)
    ]
    near = [
        k
        for k in range(at - RESIDUALS.break_rivals_near_bad, at + RESIDUALS.break_rivals_near_bad + 1)
        if 0 <= k < len(rows)
    ]
    sides = min(at, len(rows) - at) >= RESIDUALS.breaks_fewest
    for degree in RESIDUALS.break_rivals_degrees:
        smooth = basis[:, : degree + 1]
        found += _lasting(rows, time, smooth, at) if sides else []
        for count in range(MARKERS.rivals_most_bad):
            for further in combinations([k for k in near if k != at], count):
                bad = sorted((at, *further))
                kept = ~np.isin(np.arange(len(rows)), bad)
                which = tuple(int(rows[k]) for k in bad)
                found.append(_Rival(Break.SPIKES, which, smooth, kept, float(degree + len(bad))))
    return found


def _lasting(rows: np.ndarray, time: np.ndarray, smooth: np.ndarray, at: int) -> list[_Rival]:
    """Kinks, steps and quick moves beside a polynomial."""
    whole, degree = np.ones(len(rows), dtype=bool), smooth.shape[1] - 1
    found: list[_Rival] = []
    for place in np.arange(-RESIDUALS.near - 0.5, RESIDUALS.near + 0.51, 0.5):  # a kink lies between samples too
        bent = np.maximum(time - np.interp(at + place, np.arange(len(time)), time), 0.0)
        found.append(_Rival(Break.KINK, (), np.column_stack([smooth, bent]), whole, degree + 4 / 3))
    for place in range(at - RESIDUALS.near, at + RESIDUALS.near + 1):
        later = (np.arange(len(rows)) >= place).astype(float)
        found.append(_Rival(Break.STEP, (int(rows[place]),), np.column_stack([smooth, later]), whole, degree + 4 / 3))
        for width in RESIDUALS.break_rivals_ramps if degree < max(RESIDUALS.break_rivals_degrees) else ():
            share = np.clip((np.arange(len(rows)) - place + 0.5) / width + 0.5, 0.0, 1.0)
            moved = np.column_stack([smooth, share**2 * (3 - 2 * share)])
            found.append(_Rival(Break.RAMP, (), moved, whole, degree + 4 / 3))
    return found
