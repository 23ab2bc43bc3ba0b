"""Two or three faults at random times, by seed: the same number gives the same combination for ever.

The first comes at some step of some window. Each further one comes at another step likewise, or within two seconds
after the first: a fault in the middle of the reaction to another.
"""

from dataclasses import dataclass, replace

import numpy as np

from benchmarks.safety import faults
from benchmarks.safety.kinds import KINDS, LASTS, Draw, Fault, Kind, When

assert faults  # noqa: S101  # registers the kinds
SOON = (0.005, 2.0)
"""s after the first fault, evenly in its logarithm"""
WINDOWS = 2


@dataclass(frozen=True)
class Planted:
    """A fault and when it comes."""

    kind: str
    fault: Fault
    step: When
    nth: int
    after: float
    """s after the nth step of this type begins"""

    @property
    def text(self) -> str:
        when = f"{self.after:.3f} s after {self.step} {self.nth}" if self.step else "before anything begins"
        return f"{self.fault.says} ({self.kind}; {when})"


@dataclass(frozen=True)
class Combination:
    """What is done to one run."""

    number: int
    planted: tuple[Planted, ...]
    speed: float
    """m/s of moves"""


def combination(seed: int, number: int) -> Combination:
    """The faults of one run, no two of the same kind."""
    rng = np.random.default_rng([seed, number])
    count = int(rng.integers(2, 4))
    kinds = [list(KINDS.values())[k] for k in rng.choice(len(KINDS), count, replace=False)]
    first = _at_some_step(kinds[0], rng)
    planted = [first]
    for kind in kinds[1:]:
        one = _at_some_step(kind, rng)
        soon = round(float(np.exp(rng.uniform(*np.log(SOON)))), 4)
        if rng.random() < 0.5 and first.step in kind.when and first.step is not When.START:
            one = replace(one, step=first.step, nth=first.nth, after=round(first.after + soon, 4))
        planted.append(one)
    return Combination(number, tuple(planted), float(rng.choice([0.05, 0.1])))


def _at_some_step(kind: Kind, rng: np.random.Generator) -> Planted:
    draw = Draw(rng)
    step = draw.pick(*kind.when)
    nth = 1 if step in (When.START, When.ENABLE, When.TRY) else draw.whole(1, WINDOWS)
    after = draw.number(0.0, LASTS[step]) if LASTS[step] else 0.0
    return Planted(kind.name, kind.make(draw), step, nth, after)
