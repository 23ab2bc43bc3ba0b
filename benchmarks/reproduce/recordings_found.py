"""What `fidim reproduce --recordings` finds."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from benchmarks.reproduce import paper
from benchmarks.reproduce.takes import Checked, TakesIdentified, difference_percent
from fidim_lab.data.records import Body


@dataclass(frozen=True, eq=False)
class ByCables:
    """A body by maximum likelihood with geometry and friction open, from takes of some numbers of cables."""

    cables: tuple[int, ...]
    body: Body
    sd: np.ndarray
    """(9,) the ± to believe"""
    rms: float
    """m, of the fitted windows"""
    takes: int


@dataclass(frozen=True, eq=False)
class FromRecordings:
    """Everything that is printed."""

    full: TakesIdentified
    """Eq. 47"""
    decimated: TakesIdentified
    """the same from as many windows and samples as the paper says: the first twelve takes, 100 samples of each"""
    free: TakesIdentified
    """Eq. 46"""
    checked: tuple[Checked, ...]
    """Fig. 3 with the printed body of Eq. 46"""
    laboratory: Mapping[int, Body]
    """its own bodies, by the number of cables"""
    bodies: tuple[ByCables, ...]
    missing: tuple[str, ...]
    """what the folder lacks, a sentence each"""
    seconds: float

    @property
    def difference(self) -> np.ndarray:
        """Eq. 49, %."""
        free, full = (Body.from_vector(one.solution.values) for one in (self.free, self.full))
        return difference_percent(free, full)

    def above(self, *, printed: bool) -> int:
        """How many takes of Fig. 3 are above σ_W of Eq. 46, by Eq. 50 as printed or by the mean of ε²."""
        return sum((one.sigma if printed else one.mean_square) > paper.FREE.sigma_W for one in self.checked)
