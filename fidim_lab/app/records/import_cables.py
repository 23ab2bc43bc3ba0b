"""Whether a robot log's cables stand in the robot file's order: by the lengths that the poses foretell.

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

from fidim_lab.app.records.import_readings import CLEAR, SURVEYED

AGREES = 5e-3
"""m, to which lengths of a log and of the poses agree in the right order: zeros differ from take to take by less"""
CHANCE = 1e-3
"""probability below which another order is no accident"""

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
        return f"{words}. The log counts for nothing so; say --cables {named}, or exchange them in --log-map"


def cable_order(takes: Sequence[LogLengths]) -> CableOrder | None:
    """The only order in which the logs fit the poses where it is not the robot file's, else None."""
    for logged, seen, numbers in _comparisons(takes):
        found = _best(logged, seen, numbers)
        if found is not None:
            return found
    return None


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
