"""What an outstanding place in a marker's samples is: motion, some samples displaced, a step, or a blow.

All rivals are fitted to the same few samples on either side, each beside a polynomial in time that stands for the
motion; the Bayesian information criterion weighs what they explain against their freedom. A sharp turn of the motion
that a long polynomial cannot follow is followed by a short one. A kink (velocity that changes at once) is a blow: a
cable that snaps taut or a hand that knocks; the body really did that, and no sensor is at fault.
"""

from dataclasses import dataclass
from enum import Enum
from functools import cache, lru_cache
from itertools import combinations

import numpy as np
from jaxtyping import Float

from fidim_lab.identification.markers.thresholds import MARKERS


class What(Enum):
    """The rivals."""

    MOTION = "motion"
    BAD = "displaced samples"
    STEP = "a step"
    BLOW = "a kink"


@dataclass(frozen=True, eq=False)
class JudgedDefect:
    """The rival that wins."""

    what: What
    rows: tuple[int, ...] = ()
    """displaced samples, or the first after a step"""
    amplitude: Float[np.ndarray, "3"] | None = None
    """of a step"""


@dataclass(frozen=True, eq=False)
class _Rivals:
    what: tuple[What, ...]
    places: tuple[tuple[int, ...], ...]
    kept: np.ndarray
    """(C, width) of 0 and 1"""
    further: np.ndarray
    """(C, width) one more column; 0 where there is none"""
    freedom: np.ndarray
    """(C,) beyond the polynomial, in samples of three coordinates"""
    degree: np.ndarray
    """(C,) of the polynomial"""


def judge(samples: Float[np.ndarray, "G 3"], sigma: Float[np.ndarray, "3"], row: int) -> JudgedDefect | None:
    """The deviation around `row` of one marker on an even grid (NaN: missing); None with too few samples."""
    width = 2 * MARKERS.rivals_reach + 1
    piece = np.full((width, 3), np.nan)
    first, last = max(0, row - MARKERS.rivals_reach), min(len(samples), row + MARKERS.rivals_reach + 1)
    piece[first - row + MARKERS.rivals_reach : last - row + MARKERS.rivals_reach] = samples[first:last] / sigma
    seen = np.asarray(np.isfinite(piece).all(axis=1))
    rivals = _rivals()
    kept = rivals.kept * seen
    deletes = np.array([what is What.BAD for what in rivals.what])
    deleted = seen.sum() - kept.sum(axis=1)
    useful = (kept.sum(axis=1) - rivals.degree - 2 >= MARKERS.rivals_fewest) & (~deletes | (deleted == rivals.freedom))
    if not useful[0]:
        return None
    costs, sizes = _costs(np.where(seen[:, np.newaxis], piece, 0.0), kept, seen)
    costs = np.where(useful, costs, np.inf) + 3 * rivals.freedom * np.log(3 * seen.sum())
    best = int(np.argmin(costs))
    innocent = [k for k, what in enumerate(rivals.what) if what in (What.MOTION, What.BLOW)]
    if rivals.what[best] in (What.BAD, What.STEP):
        rival = min(innocent, key=lambda k: costs[k])
        best = best if costs[best] + MARKERS.rivals_clearer < costs[rival] else rival
    rows = tuple(row + place for place in rivals.places[best])
    return JudgedDefect(rivals.what[best], rows, sizes[best] * sigma)


def _costs(piece: np.ndarray, kept: np.ndarray, seen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """χ² that each rival leaves of the seen samples, and the size of its further column (C, 3)."""
    design, solve = _fits(seen.tobytes())
    middle = piece.sum(axis=0) / max(1, np.count_nonzero(kept[0]))
    values = (piece - middle) * kept[..., np.newaxis]
    found = solve @ values
    left = values - design @ found
    return (left**2).sum(axis=(1, 2)), found[:, -1]


@lru_cache(maxsize=256)
def _fits(seen: bytes) -> tuple[np.ndarray, np.ndarray]:
    """(C, width, D) columns of each rival, (C, D, width) what fits them; few patterns of seen samples come up."""
    rivals, basis = _rivals(), _basis()
    kept = rivals.kept * np.frombuffer(seen, dtype=bool)
    terms = np.arange(basis.shape[1]) <= rivals.degree[:, np.newaxis]
    columns = [terms[:, np.newaxis] * basis, rivals.further[..., np.newaxis]]
    design = np.concatenate(columns, axis=2) * kept[..., np.newaxis]
    used = np.column_stack([terms, rivals.further.any(axis=1)])
    normal = np.swapaxes(design, 1, 2) @ design
    normal[:, range(used.shape[1]), range(used.shape[1])] += np.where(used, 1e-10, 1.0)
    return design, np.linalg.solve(normal, np.swapaxes(design, 1, 2))


@cache
def _basis() -> Float[np.ndarray, "width D"]:
    return np.polynomial.legendre.legvander(
        np.arange(-MARKERS.rivals_reach, MARKERS.rivals_reach + 1) / MARKERS.rivals_reach, max(MARKERS.rivals_sharper)
    )


@cache
def _rivals() -> _Rivals:
    rows = np.arange(-MARKERS.rivals_reach, MARKERS.rivals_reach + 1)
    whole, nothing = np.ones(len(rows)), np.zeros(len(rows))
    found: list[tuple[What, tuple[int, ...], np.ndarray, np.ndarray, float, int]] = [
        (What.MOTION, (), whole, nothing, float(degree - MARKERS.rivals_degree), degree)
        for degree in (MARKERS.rivals_degree, *MARKERS.rivals_sharper)
    ]
    # a kink lies between samples too, and is as free in time as in size
    for at in np.arange(-2.5, 2.51, 0.5):
        found.append((What.BLOW, (round(at),), whole, np.maximum(rows - at, 0.0), 4 / 3, MARKERS.rivals_degree))
    for at in range(-2, 3):
        found.append((What.STEP, (at,), whole, (rows >= at).astype(float), 4 / 3, MARKERS.rivals_degree))
    near = range(-MARKERS.rivals_near_bad, MARKERS.rivals_near_bad + 1)
    for count in range(1, MARKERS.rivals_most_bad + 1):
        for bad in combinations(near, count):
            kept = np.where(np.isin(rows, bad), 0.0, 1.0)
            found.append((What.BAD, bad, kept, nothing, float(count), MARKERS.rivals_degree))
    what, places, kept, further, freedom, degree = zip(*found, strict=True)
    return _Rivals(what, places, np.array(kept), np.array(further), np.array(freedom), np.array(degree))
