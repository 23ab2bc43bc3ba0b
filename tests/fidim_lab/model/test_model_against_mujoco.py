"""The same robot as a multibody model (`mujoco_world.multibody`): an independent formulation and engine."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fidim_lab.data.records import Body, Pose, Robot
from fidim_lab.model.kinematics import dependent_pose, pose_from_lengths
from fidim_lab.model.motion import simulate_free_motion
from sim_backends.mujoco_world.multibody import STEP, multibody_xml
from sim_backends.plant.world import World

mujoco = pytest.importorskip("mujoco")

BODY = Body(
    com=np.array([0.0049, -0.0012, 0.1913]), inertia=np.array([0.0643, 0.0541, 0.0301, 0.0003, 0.0005, -0.0004])
)


def by_mujoco(robot: Robot, body: Body, pose: Pose, samples: int):
    """Positions of P and rotations at 100 Hz."""
    world = World(robot.cables, robot.mass, body, robot.markers, robot.gravity, None)
    model = mujoco.MjModel.from_xml_string(multibody_xml(world, pose))
    data = mujoco.MjData(model)
    positions, rotations = np.empty((samples, 3)), np.empty((samples, 3, 3))
    for k in range(samples):
        positions[k] = data.qpos[:3]
        rotations[k] = Rotation.from_quat(data.qpos[3:7], scalar_first=True).as_matrix()
        mujoco.mj_step(model, data, nstep=round(0.01 / STEP))
    return positions, rotations


@pytest.mark.parametrize("lengths", [(1.38, 1.39, 1.36, 1.32), (1.66, 1.86, 1.68, 1.41)])
def test_another_formulation_moves_alike(paper, lengths):
    rest = pose_from_lengths(paper, BODY, np.array(lengths))
    marker, axes = paper.robot.marker, (0, 2) if lengths[0] > 1.5 else (0, 1)
    values = rest.pose.position[list(axes)] + np.array([0.02, 0.001 if axes[1] == 2 else 0.015])
    positions, rotations = dependent_pose(paper, rest.lengths, marker, axes, values[None], rest.pose)
    start = Pose(positions[0], rotations[0])
    found = simulate_free_motion(paper, BODY, start, np.zeros(6), np.arange(301) * 0.01)
    assert found.slack_time is None
    positions, rotations = by_mujoco(paper.robot, BODY, start, 301)
    assert np.ptp(positions, axis=0).max() > 0.02
    np.testing.assert_allclose(found.motion.positions, positions, atol=1e-5)
    np.testing.assert_allclose(found.motion.rotations, rotations, atol=1e-4)
