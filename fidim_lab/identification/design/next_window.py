"""The next best window: the random window within the limits that reduces the covariance most."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from fidim_lab.identification.design.information import information, judged, predicted_sd
from fidim_lab.identification.design.pool import Pool
from fidim_lab.identification.design.task import DesignTask
from fidim_lab.identification.design.windows import place
from fidim_lab.model.mechanism import Mechanism


@dataclass(frozen=True, eq=False)
class NextWindow:
    """The window to record next, and its expected effect."""

    z: Float[np.ndarray, " z"]
    """[lengths; displacement of the marker], m"""
    sd_before: Float[np.ndarray, "9"]
    sd_after: Float[np.ndarray, "9"]


def next_window(
    mechanism: Mechanism,
    task: DesignTask,
    covariance: Float[np.ndarray, "9 9"],
    pool: Pool,
    body: Float[np.ndarray, "9"] | None = None,
) -> NextWindow:
    """The window of the pool after which the task's criterion (A or D) is least.

    covariance: of the nine base parameters as they are known (`Fit.covariance`). body: the one identified; nominal
    without it. Raises InfeasibleError where a window of the pool cannot be placed.
    """
    placed = [place(mechanism, task, z) for z in pool.z]
    each = information(mechanism, task, placed, body)
    known = np.linalg.inv(covariance)
    best = int(np.argmin(judged(task, known + each)))
    return NextWindow(pool.z[best], np.sqrt(np.diag(covariance)), predicted_sd(known + each[best]))
