"""One cable: yaw is held by nothing but the hand, and the platform still finds its rest and can be pulled aside."""

import numpy as np
import pytest

from fidim_lab.app import compose
from fidim_lab.data.records import Body, Cable, Pose, Robot
from sim_backends.plant.mechanics import Statics


@pytest.fixture(scope="module")
def hung_on_one() -> Statics:
    cable = Cable(
        d=np.array([0.0, 0.0, 2.4]),
        a=np.array([0.0, 0.0, 0.02]),
        radius=0.0,
        x=np.array([0.0, 1.0, 0.0]),
        y=np.array([0.0, 0.0, -1.0]),
        z=np.array([-1.0, 0.0, 0.0]),
    )
    body = Body(np.array([0.0, 0.0, -0.08]), np.array([0.060, 0.062, 0.070, 0.0, 0.0, 0.0]))
    robot = Robot(cables=(cable,), mass=6.0, nominal=body, marker=np.array([0.25, 0.0, 0.0]))
    return Statics(compose.simulated_world(robot, 3, ()))


@pytest.mark.parametrize("length", [0.22, 0.33, 0.8997, 1.1171, 1.5934, 1.7316])
@pytest.mark.parametrize("aside", [(0.05, 0.0), (0.0, -0.05), (-0.03, 0.04)])
@pytest.mark.sampled(8)
def test_rest_and_pulled_aside(hung_on_one: Statics, length: float, aside: tuple[float, float]) -> None:
    lengths = np.array([length])
    rest = hung_on_one.rest(lengths, Pose(np.array([0.0, 0.0, 2.4 - length]), np.eye(3)))
    held = hung_on_one.held_aside(rest, lengths, np.array(aside))
    np.testing.assert_allclose(held.marker[:2], rest.marker[:2] + aside, atol=1e-4)
    assert rest.tensions[0] > 0
