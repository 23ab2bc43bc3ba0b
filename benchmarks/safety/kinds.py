"""What a kind of fault is, and the register of all of them. A new kind is a function of a few lines in `faults`."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np

from benchmarks.rehearsal import Stage

CABLES = 4
REACTION = 0.01
"""m of cable within which motion that nobody commanded is to be stopped (issue 35, 1)"""
NEVER = math.inf
"""s of reaction: the bus cannot stop this drive; it goes where it was going"""


class When(StrEnum):
    """Steps at whose beginning a fault may come."""

    START = ""
    ENABLE = "Enable"
    TRY = "TryWinches"
    MOVE = "MoveTo"
    SETTLE = "Settle"
    CHECK = "CheckTension"
    ASK = "Ask"
    AWAY = "AwaitHandsOff"
    RECORD = "Record"
    VERDICT = "CheckWindow"


LASTS = {
    When.START: 0.0,
    When.ENABLE: 0.2,
    When.TRY: 10.0,
    When.MOVE: 0.9,
    When.SETTLE: 0.3,
    When.CHECK: 0.2,
    When.ASK: 4.0,
    When.AWAY: 0.3,
    When.RECORD: 1.5,
    When.VERDICT: 0.0,
}
"""s that a step takes without faults: a fault comes within it"""
POWERED = (When.TRY, When.MOVE, When.SETTLE, When.CHECK, When.ASK, When.AWAY, When.RECORD, When.VERDICT)
ANY = (When.ENABLE, *POWERED)
RESTING = (When.SETTLE, When.CHECK, When.ASK, When.RECORD, When.VERDICT)


@dataclass(frozen=True)
class Fault:
    """One fault with its size."""

    says: str
    """in words, with numbers"""
    strike: Callable[[Stage], Any]
    cables: tuple[int, ...] = ()
    """that may move alone for it, or be out of step with the others"""
    reaction: float = 0.0
    """s that pass until such a drive can be stopped at all, when its speed counts instead of `REACTION`"""
    itself: float = 0.0
    """m by which the fault itself moves a cable, before anybody can react"""


class Draw:
    """Random sizes for one fault."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng

    def cable(self) -> int:
        return int(self._rng.integers(1, CABLES + 1))

    def two(self) -> tuple[int, int]:
        """Different cables."""
        first, second = self._rng.choice(np.arange(1, CABLES + 1), 2, replace=False)
        return int(first), int(second)

    def number(self, low: float, high: float) -> float:
        """Evenly distributed."""
        return round(float(self._rng.uniform(low, high)), 4)

    def size(self, low: float, high: float) -> float:
        """Of either sign; small ones as often as large ones."""
        return round(float(np.exp(self._rng.uniform(np.log(low), np.log(high))) * self._rng.choice([-1, 1])), 5)

    def some(self, low: float, high: float) -> float:
        """Positive; small ones as often as large ones."""
        return abs(self.size(low, high))

    def whole(self, low: int, high: int) -> int:
        return int(self._rng.integers(low, high + 1))

    def pick(self, *of: Any) -> Any:
        return of[self._rng.integers(len(of))]

    def offset(self, low: float, high: float) -> tuple[float, float, float]:
        """A vector of random direction, m."""
        way = self._rng.standard_normal(3)
        x, y, z = self.some(low, high) * way / np.linalg.norm(way)
        return round(float(x), 4), round(float(y), 4), round(float(z), 4)


Make = Callable[[Draw], Fault]


@dataclass(frozen=True)
class Kind:
    """A kind of fault."""

    name: str
    area: str
    when: tuple[When, ...]
    make: Make


KINDS: dict[str, Kind] = {}
"""by name, in the order of the modules of `faults`"""


def kind(area: str, name: str, *when: When) -> Callable[[Make], Make]:
    """Register what makes faults of one kind; they come at one of these steps."""

    def register(make: Make) -> Make:
        if name in KINDS:
            raise ValueError(f"two kinds are called {name!r}")
        KINDS[name] = Kind(name, area, when, make)
        return make

    return register


def mm(metres: float) -> str:
    return f"{1e3 * metres:+.1f} mm"
