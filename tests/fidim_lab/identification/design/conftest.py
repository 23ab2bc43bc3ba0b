"""A small design task on the paper's robot, and a pool of random windows for it: short motions, no compiler."""

from dataclasses import dataclass

import numpy as np
import pytest

from fidim_lab.data.records import Robot
from fidim_lab.identification.design import pool
from fidim_lab.identification.design.task import DesignTask
from fidim_lab.model.mechanism import Mechanism


@dataclass(frozen=True, eq=False)
class Drawn:
    """A task with its model and the random windows from which its designs begin."""

    task: DesignTask
    mechanism: Mechanism
    pool: pool.Pool


@pytest.fixture(scope="session")
def drawn(irma4: Robot) -> Drawn:
    """Three equilibria of 2 s; the pool of nine is drawn once and not changed."""
    task = DesignTask(irma4, equilibria=3, samples=25, seconds=2.0, native=False)
    mechanism = task.mechanism()
    found = pool.draw(mechanism, task, 9, np.random.default_rng(5), lambda _: None)
    return Drawn(task, mechanism, found)
