"""Motion under moving winches: the cables follow what was commanded, and locked ones give the free motion."""

import numpy as np
import pytest

from fidim_lab.data.records import Robot
from fidim_lab.model.equilibria import equilibrium_at
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion import driven_motions
from fidim_lab.model.motion.driven import STEP


@pytest.fixture(scope="module")
def mechanism(irma4: Robot) -> Mechanism:
    return Mechanism(irma4)


def test_cables_follow_their_commands(irma4: Robot, mechanism: Mechanism):
    rest = equilibrium_at(mechanism, irma4.nominal, np.array([1.25, -0.15, -0.2]))
    rng = np.random.default_rng(3)
    accelerations = np.repeat(rng.uniform(-1, 1, (1, 4, irma4.n)), 10, axis=1)
    driven = driven_motions(mechanism, irma4.nominal, rest.pose, accelerations)
    speeds = np.vstack([np.zeros(irma4.n), np.cumsum(STEP * accelerations[0], axis=0)])
    wanted = rest.lengths + np.vstack([np.zeros(irma4.n), np.cumsum(STEP * (speeds[1:] + speeds[:-1]) / 2, axis=0)])
    found = mechanism.lengths(driven.positions[0], driven.rotations[0])
    np.testing.assert_allclose(found, wanted, atol=1e-7)
    xi = mechanism.structure_matrix(driven.positions[0], driven.rotations[0])
    np.testing.assert_allclose((xi @ driven.twists[0][..., None])[..., 0], speeds, atol=1e-6)


def test_locked_winches_leave_the_platform_at_rest(irma4: Robot, mechanism: Mechanism):
    rest = equilibrium_at(mechanism, irma4.nominal, np.array([1.25, -0.15, -0.2]))
    driven = driven_motions(mechanism, irma4.nominal, rest.pose, np.zeros((2, 40, irma4.n)))
    np.testing.assert_allclose(driven.positions, np.broadcast_to(rest.pose.position, driven.positions.shape), atol=1e-9)
    np.testing.assert_allclose(driven.tensions[0, -1], rest.tensions, rtol=1e-6)
