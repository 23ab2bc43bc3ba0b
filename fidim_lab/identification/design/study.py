"""The paper's study (§5.1): C with more equilibria and more samples of each window."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from fidim_lab.identification.design import pool
from fidim_lab.identification.design.search import FOR_EACH, DesignStart, begin_at
from fidim_lab.identification.design.task import Criterion, DesignTask
from fidim_lab.identification.design.windows import place
from fidim_lab.mapping import Map
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.say import Say

EQUILIBRIA, SAMPLES = (8, 10, 12, 14, 16), (50, 75, 100, 125, 150)
"""the paper's ranges"""


@dataclass(frozen=True)
class Cell:
    """The best results with so many equilibria and samples."""

    equilibria: int
    samples: int
    values: tuple[float, ...]
    """C of each start; infinite where none within the limits was met"""
    seconds: float
    """a start, median"""

    @property
    def best(self) -> float:
        """Of all starts."""
        return min(self.values)


def study(
    task: DesignTask,
    starts: int,
    seed: int,
    run: Map,
    say: Say,
    equilibria: Iterable[int] = EQUILIBRIA,
    samples: Iterable[int] = SAMPLES,
) -> list[Cell]:
    """Every combination, from one pool of random windows. Starts are not polished: their spread is part of the answer.

    Raises InfeasibleError where hardly any place obeys the limits.
    """
    sizes = [(n_e, n_s) for n_s in samples for n_e in equilibria]
    mechanism = task.mechanism()
    tasks = {
        size: replace(task, equilibria=size[0], samples=size[1], criterion=Criterion.C, bodies=()) for size in sizes
    }
    largest = max(tasks.values(), key=lambda one: one.equilibria)
    wanted = FOR_EACH * largest.equilibria
    rng = np.random.default_rng([seed, 0])
    drawn = pool.draw(mechanism, largest, wanted, rng, lambda k: say(f"{k} of {wanted} random windows"))
    of_samples = {n_s: _resampled(mechanism, replace(largest, samples=n_s), drawn) for _, n_s in sizes}
    todo = [DesignStart(tasks[size], of_samples[size[1]], (seed, 1 + k)) for size in sizes for k in range(starts)]
    found = []
    for one in run(begin_at, todo):
        found.append(one)
        say(f"start {len(found)} of {len(todo)}")
    cells = [found[k * starts : (k + 1) * starts] for k in range(len(sizes))]
    return [
        Cell(*size, tuple(one.value for one in some), float(np.median([one.seconds for one in some])))
        for size, some in zip(sizes, cells, strict=True)
    ]


def _resampled(mechanism: Mechanism, task: DesignTask, drawn: pool.Pool) -> pool.Pool:
    """The same windows with the tables of another number of samples."""
    tables, _ = pool.judged(mechanism, task, [place(mechanism, task, z) for z in drawn.z])
    return pool.Pool(drawn.z, tables)
