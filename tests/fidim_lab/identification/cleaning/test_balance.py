"""What noise of the markers leaves over in the equations of motion, foretold at each node."""

import numpy as np
import pytest

from fidim_lab.identification.cleaning.balance import balance
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.regressor import parameter_vector


@pytest.mark.parametrize("cluster", [False, True], ids=["one marker", "four markers"])
def test_noise_leaves_over_as_much_as_foretold(recorded, cluster):
    exact = recorded(cluster=cluster, seconds=3.0)
    robot, chi = exact.robot, parameter_vector(exact.robot.nominal)
    mechanism, sigma = Mechanism(robot), robot.sensors.marker_noise
    clean = balance(mechanism, exact.windows[0])
    seen = []
    for seed in range(30):
        found = balance(mechanism, recorded(cluster=cluster, seconds=3.0, noise=sigma, seed=seed).windows[0])
        seen.append((np.square((found.left - clean.left) @ chi)).sum(axis=1))
    ratio = np.mean(seen) / np.mean(clean.noise)
    assert 0.5 < ratio < 2.0  # by the nominal body, and without what noise does to places
