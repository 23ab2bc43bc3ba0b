"""The robot files of examples/ are read, and can rest: the bifilar and the trifilar pendulum of docs/pendulums.md."""

from pathlib import Path

import numpy as np
import pytest

from fidim_lab.app.doctor.robot_plausibility import middle_rests, rest
from fidim_lab.data.records import Pose
from fidim_lab.data.robot_file import read_robot
from fidim_lab.identification.random_plan import random_plan
from fidim_lab.model.equilibria import pose_from_lengths
from fidim_lab.model.mechanism import Mechanism

ROBOTS = Path(__file__).parents[3] / "examples" / "robots"


def test_each_pendulum_is_covered():
    assert {path.stem for path in ROBOTS.glob("*.toml")} >= {"bifilar", "trifilar"}


@pytest.mark.parametrize(("name", "cables"), [("bifilar", 2), ("trifilar", 3)])
def test_a_pendulum_hangs_on_taut_cords(name, cables):
    robot = read_robot(ROBOTS / f"{name}.toml")
    assert robot.n == cables
    assert len(robot.markers) == 4
    mechanism = Mechanism(robot)
    below = Pose(np.array([0.0, 0.0, 0.4]), np.eye(3))
    rest = pose_from_lengths(mechanism, robot.nominal, np.full(cables, 2.0), below)
    assert rest.pose.position[2] == pytest.approx(0.4, abs=0.05)
    assert (robot.mass * rest.tensions > 0).all()
    assert robot.mass * rest.tensions.sum() == pytest.approx(robot.mass * 9.81, rel=0.01)


@pytest.mark.parametrize("name", ["bifilar", "trifilar"])
def test_an_example_can_be_simulated_and_passes_its_checks(name: str):
    """The trifilar's main marker, at the rim of its plate, reaches hardly any place that is drawn below the anchors."""
    robot = read_robot(ROBOTS / f"{name}.toml")
    assert rest(robot, middle_rests(Mechanism(robot))).ok
    assert len(random_plan(robot, name, 2, 1, seed=11).windows) == 3
