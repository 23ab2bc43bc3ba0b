"""The next window is the one that a full search over the pool would take."""

from dataclasses import replace

import numpy as np

from fidim_lab.identification.design.information import information
from fidim_lab.identification.design.next_window import next_window
from fidim_lab.identification.design.task import Criterion
from fidim_lab.identification.design.windows import place
from fidim_lab.identification.mle.starts.possible import scales


def test_the_window_that_shrinks_the_covariance_most(drawn):
    task = replace(drawn.task, criterion=Criterion.A)
    placed = [place(drawn.mechanism, task, z) for z in drawn.pool.z]
    each = information(drawn.mechanism, task, placed)
    known = each[0] + each[1]
    found = next_window(drawn.mechanism, task, np.linalg.inv(known), drawn.pool)
    scale = scales(task.robot.nominal)
    spread = [np.sum(np.diag(np.linalg.inv(known + one)) / scale**2) for one in each]
    assert found.z.tobytes() == drawn.pool.z[int(np.argmin(spread))].tobytes()
    assert (found.sd_after < found.sd_before).all()
