"""Whether a robot log's cables stand in the robot file's order, and count as said: by the lengths that poses foretell.

Each cable of the robot file is given one of the log, so that lengths by log and by poses differ least. The log's zeros
may be known, the same in all takes, or those of each take. Another order is told where chance would hardly make it fit
so much better: of n! orders one comes nearer by a factor f with a probability of n! / f^m, for m numbers compared.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import factorial

import numpy as np
from jaxtyping import Float
from scipy.optimize import linear_sum_assignment

from fidim_lab.app.records.import_readings import CLEAR, FAR, SURVEYED

AGREES = 5e-3
"""m, to which lengths of a log and of the poses agree in the right order: zeros differ from take to take by less"""
CHANCE = 1e-3
"""probability below which another order is no accident"""

FEWEST_AT_REST = 3
"""windows"""
SAME_FACTOR = 0.05
"""by which a factor may be another one through survey and zeros that differ by `AGREES`, where cables move by 10 cm"""

Lengths = Float[np.ndarray, "K n"]
"""m"""


@dataclass(frozen=True, eq=False)
class LogLengths:
    """Lengths of one take, by its log and by its poses."""

    at_rest: tuple[Lengths, Lengths]
    """medians of each window: by the log, by the poses"""
    moving: tuple[Lengths, Lengths]
    """alike, at some samples of the whole take, as far as the two clocks are known"""


@dataclass(frozen=True)
class CableOrder:
    """An order of a log's cables that fits the poses."""

    order: tuple[int, ...]
    """1-based: the robot file's cable k is the log's order[k − 1]"""
    as_read: float
    """m rms, by which lengths by log and by poses differ"""
    fits: float
    """m rms, in that order"""

    @property
    def says(self) -> str:
        """For a person, with the option that sets it right."""
        named = ",".join(map(str, self.order))
        words = f"the robot file's cables 1 to {len(self.order)} are the log's {named}: as read, lengths by log and by"
        words = f"{words} poses differ by {self.as_read * 1e3:.3g} mm rms, in that order by {self.fits * 1e3:.2g} mm"
        return f"{words}. Therefore the log is not used; give --cables {named}, or exchange them in --log-map"


def cable_order(takes: Sequence[LogLengths]) -> CableOrder | None:
    """The only order in which the logs fit the poses where it is not the robot file's, else None."""
    for logged, seen, numbers in _comparisons(takes):
        found = _best(logged, seen, numbers)
        if found is not None:
            return found
    return None


def miscounted(takes: Sequence[LogLengths]) -> str:
    """Which cables' logs count the other way round, by another scale, or anew in each take, in words; else empty.

    Lengths at rest, by log and by poses, differ between windows by one factor for a cable: 1 if its log is right. Three
    windows are needed, since two fit any factor.
    """
    rest = [take.at_rest for take in takes]
    if sum(len(logged) for logged, _ in rest) < FEWEST_AT_REST:
        return ""
    logged, seen = (np.concatenate([pair[k] for pair in rest]) for k in (0, 1))
    logged, seen = logged - logged.mean(axis=0), seen - seen.mean(axis=0)
    told: dict[str, list[str]] = {}
    for cable, (by_log, by_poses) in enumerate(zip(logged.T, seen.T, strict=True), start=1):
        if words := _miscounts(by_log, by_poses):
            told.setdefault(words, []).append(str(cable))
    return "; ".join(f"the log of cable {', '.join(cables)} {words}" for words, cables in told.items())


def _miscounts(logged: np.ndarray, seen: np.ndarray) -> str:
    """How one cable's lengths (K,) m by the log, about their mean, go with those of the poses; empty where they do."""
    as_read, moves = _rms(seen - logged), _rms(logged)
    if moves <= AGREES and as_read > FAR * AGREES:
        return (
            "has the same length in all windows, the poses have not: it counts from its own start in each take, so "
            "that its zeros are unknown"
        )
    factor = float(seen @ logged / max(logged @ logged, 1e-12))
    fits = _rms(seen - factor * logged)
    if not (fits <= AGREES and FAR * max(fits, SURVEYED) < as_read):
        return ""
    if abs(factor + 1.0) < SAME_FACTOR:
        return "counts the other way round: change the sign of its metres_per_count in --log-map, or of its column"
    return (
        f"moves {1.0 / factor:.3g} times as far as the poses: correct its metres_per_count or length_unit in --log-map "
        "(radius or diameter, turns of drum or motor)"
    )


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _comparisons(takes: Sequence[LogLengths]) -> Iterator[tuple[Lengths, Lengths, int]]:
    """Lengths by log and by poses less what is unknown of them, and how many independent numbers these are."""
    if not takes:
        return
    n = takes[0].at_rest[0].shape[1]
    for moving in (False, True):
        parts = [take.moving if moving else take.at_rest for take in takes]
        logged, seen = (np.concatenate([part[k] for part in parts]) for k in (0, 1))
        if not len(logged):
            continue
        yield logged, seen, n * (1 if moving else len(logged))
        yield logged - logged.mean(axis=0), seen - seen.mean(axis=0), n * (1 if moving else len(logged) - 1)
        alone = [tuple(one - one.mean(axis=0) for one in part) for part in parts if len(part[0])]
        own = n * sum(1 if moving else len(part[0]) - 1 for part in alone)
        yield np.concatenate([part[0] for part in alone]), np.concatenate([part[1] for part in alone]), own


def _best(logged: Lengths, seen: Lengths, numbers: int) -> CableOrder | None:
    n = logged.shape[1]
    squares = np.mean((seen[:, :, np.newaxis] - logged[:, np.newaxis, :]) ** 2, axis=0)
    order = linear_sum_assignment(squares)[1]
    rows = np.arange(n)
    as_read, fits = (float(np.sqrt(squares[rows, columns].mean())) for columns in (rows, order))
    unlike = numbers > 0 and factorial(n) * (max(fits, SURVEYED) / max(as_read, SURVEYED)) ** numbers < CHANCE
    if fits > AGREES or not unlike or _second(squares, order) < CLEAR * fits:
        return None
    return CableOrder(tuple(int(k) + 1 for k in order), as_read, fits)


def _second(squares: np.ndarray, order: np.ndarray) -> float:
    """m rms of the order next to the best one."""
    found: list[float] = []
    for row, column in enumerate(order):
        other = squares.copy()
        other[row, column] = 1e6 + squares.sum()
        columns = linear_sum_assignment(other)[1]
        found.append(float(np.sqrt(squares[np.arange(len(order)), columns].mean())))
    return min(found)
