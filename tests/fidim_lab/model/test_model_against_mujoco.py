"""The same robot as a multibody model: swivelling pulleys as bodies, cables as tendons round cylinders (FINDINGS.md).

MuJoCo's cylinder has no groove, so each swivel is kept in the cable's plane by two guide tendons held equally long.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fidim_lab.data.records import Body, Pose
from fidim_lab.model.dynamics import simulate_free_motion
from fidim_lab.model.kinematics import dependent_pose, pose_from_lengths

mujoco = pytest.importorskip("mujoco")

BODY = Body(
    com=np.array([0.0049, -0.0012, 0.1913]), inertia=np.array([0.0643, 0.0541, 0.0301, 0.0003, 0.0005, -0.0004])
)
STEP = 5e-4
SIDE_ANGLE = 1.9  # rad along the wrap: within 60-160 degrees, or the tendon goes straight through the pulley


def text(values):
    return " ".join(f"{value:.17g}" for value in np.ravel(values))


def swivel_xml(number, cable, attachment):
    c = attachment - cable.d
    u = c - (c @ cable.z) * cable.z
    u /= np.linalg.norm(u)
    r = cable.radius
    side = [r - 1.5 * r * np.cos(SIDE_ANGLE), 0, 1.5 * r * np.sin(SIDE_ANGLE)]
    return f"""
    <body name="swivel{number}" pos="{text(cable.d)}" xyaxes="{text(u)} {text(np.cross(cable.z, u))}">
      <inertial pos="0 0 0" mass="1e-4" diaginertia="1e-8 1e-8 1e-8"/>
      <joint type="hinge" axis="0 0 1"/>
      <geom name="pulley{number}" type="cylinder" size="{r} 0.02" pos="{r} 0 0" zaxis="0 1 0"/>
      <site name="entry{number}" pos="0 0 -0.001"/>
      <site name="side{number}" pos="{text(side)}"/>
      <site name="left{number}" pos="0 0.05 0"/>
      <site name="right{number}" pos="0 -0.05 0"/>
    </body>"""


def tendon_xml(number):
    return f"""
    <spatial name="cable{number}"><site site="entry{number}"/><geom geom="pulley{number}" sidesite="side{number}"/>
      <site site="a{number}"/></spatial>
    <spatial name="left{number}"><site site="left{number}"/><site site="a{number}"/></spatial>
    <spatial name="right{number}"><site site="right{number}"/><site site="a{number}"/></spatial>"""


def multibody(robot, body, pose):
    """The robot in this pose; its tendons keep the lengths they have there."""
    stiff = 'solref="0.001 1" solimp="0.9999 0.99999 0.001"'
    cables = list(enumerate(robot.cables))
    quaternion = Rotation.from_matrix(pose.rotation).as_quat(scalar_first=True)
    return f"""<mujoco>
  <option timestep="{STEP}" integrator="RK4" gravity="{text(robot.gravity)}" tolerance="1e-12" iterations="100">
    <flag contact="disable"/></option>
  <compiler autolimits="false" balanceinertia="false"/>
  <worldbody>
    <body name="platform" pos="{text(pose.position)}" quat="{text(quaternion)}">
      <freejoint/>
      <inertial pos="{text(body.com)}" mass="{robot.mass}" fullinertia="{text(about_com(body) * robot.mass)}"/>
      {"".join(f'<site name="a{i}" pos="{text(cable.a)}"/>' for i, cable in cables)}
    </body>
    {"".join(swivel_xml(i, cable, pose.position + pose.rotation @ cable.a) for i, cable in cables)}
  </worldbody>
  <tendon>{"".join(tendon_xml(i) for i, _ in cables)}</tendon>
  <equality>
    {"".join(f'<tendon tendon1="cable{i}" polycoef="0 0 0 0 0" {stiff}/>' for i, _ in cables)}
    {"".join(f'<tendon tendon1="left{i}" tendon2="right{i}" polycoef="0 1 0 0 0" {stiff}/>' for i, _ in cables)}
  </equality>
</mujoco>"""


def about_com(body):
    matrix = body.inertia_about_com
    return np.array([matrix[0, 0], matrix[1, 1], matrix[2, 2], matrix[0, 1], matrix[0, 2], matrix[1, 2]])


def by_mujoco(robot, body, pose, samples):
    """Positions of P and rotations at 100 Hz."""
    model = mujoco.MjModel.from_xml_string(multibody(robot, body, pose))
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
    np.testing.assert_allclose(found.motion.positions, positions, atol=3e-5)
    np.testing.assert_allclose(found.motion.rotations, rotations, atol=3e-4)
