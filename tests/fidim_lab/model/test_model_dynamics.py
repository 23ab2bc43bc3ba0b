"""Free motion: conserved energy and lengths, Eq. 10 along it, slackness, convergence."""

import numpy as np
import pytest

from fidim_lab.data.records import Body, Pose
from fidim_lab.errors import InfeasibleError, SetupError
from fidim_lab.model.kinematics import dependent_pose, equilibrium_at, pose_from_lengths
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.modes import modes
from fidim_lab.model.motion import free_twist_basis, marker_selector, simulate_free_motion
from fidim_lab.model.motion.dynamics import accelerations
from fidim_lab.model.motion.rigid_body import energy
from fidim_lab.model.regressor import free_regressor, parameter_vector, platform_regressor
from fidim_lab.model.slots import Effect
from fidim_lab.model.statics import tensions

TIMES = np.arange(0, 10.0001, 0.01)
LENGTHS = np.array([1.38, 1.39, 1.36, 1.32])  # Table 2, k = 6


def displaced(mechanism, rest, by):
    marker = mechanism.robot.marker
    values = (rest.marker_position(marker)[:2] + by)[None]
    positions, rotations = dependent_pose(mechanism, rest.lengths, marker, (0, 1), values, rest.pose)
    return Pose(positions[0], rotations[0])


@pytest.fixture(scope="module")
def swing(paper):
    """The paper's robot let go 36 mm from rest."""
    rest = pose_from_lengths(paper, paper.robot.nominal, LENGTHS)
    start = displaced(paper, rest, np.array([0.03, 0.02]))
    return simulate_free_motion(paper, paper.robot.nominal, start, np.zeros(6), TIMES)


def test_energy_and_lengths_are_kept_for_ten_seconds(paper, swing):
    motion = swing.motion
    stored = energy(paper, paper.robot.nominal, motion.positions, motion.rotations, motion.twists)
    kinetic = 0.5 * (motion.twists[:, :3] ** 2).sum(axis=1).max()
    assert np.ptp(stored) < 1e-4 * kinetic
    np.testing.assert_allclose(
        paper.lengths(motion.positions, motion.rotations), np.tile(LENGTHS, (1001, 1)), atol=3e-7
    )
    assert swing.slack_time is None
    assert swing.tensions.min() > 0


def test_energy_and_lengths_are_kept_by_any_number_of_cables(other):
    body = other.robot.nominal
    lengths = np.full(other.n, 1.3)
    if other.n == 5:
        lengths = equilibrium_at(other, body, np.array([-0.1, -0.1, -0.1])).lengths
    rest = pose_from_lengths(other, body, lengths)
    free = np.linalg.svd(other.structure_matrix(rest.pose.position[None], rest.pose.rotation[None])[0])[2][other.n :]
    twist = 0.15 * free.sum(axis=0)
    found = simulate_free_motion(other, body, rest.pose, twist, TIMES)
    assert found.slack_time is None
    motion = found.motion
    assert np.ptp(motion.positions, axis=0).max() > 0.005
    stored = energy(other, body, motion.positions, motion.rotations, motion.twists)
    assert np.ptp(stored) < 1e-5
    np.testing.assert_allclose(other.lengths(motion.positions, motion.rotations) - lengths, 0, atol=1e-6)


def test_a_lone_cable_spins_for_many_turns(make_robot):
    """More than a full turn: no chart of the rotation may end."""
    mechanism = Mechanism(make_robot(1))
    body = mechanism.robot.nominal
    rest = pose_from_lengths(mechanism, body, np.array([1.3]))
    attachment = rest.pose.rotation @ mechanism.robot.cables[0].a
    twist = np.concatenate([-np.cross([0, 0, 2.0], attachment), [0, 0, 2.0]])
    motion = simulate_free_motion(mechanism, body, rest.pose, twist, TIMES).motion
    heading = np.unwrap(np.arctan2(motion.rotations[:, 1, 0], motion.rotations[:, 0, 0]))
    assert heading[-1] - heading[0] > 3 * np.pi
    np.testing.assert_allclose(motion.rotations[-1] @ motion.rotations[-1].T, np.eye(3), atol=1e-11)


def test_the_regressor_vanishes_along_a_free_motion(paper, swing):
    motion, chi = swing.motion, parameter_vector(paper.robot.nominal)
    xi = paper.structure_matrix(motion.positions, motion.rotations)
    basis = free_twist_basis(xi, marker_selector(motion.rotations, paper.robot.marker, (0, 1)))
    reduced = free_regressor(motion, paper.robot.gravity, basis)
    assert reduced.shape == (1001, 2, 10)
    np.testing.assert_allclose(reduced @ chi, 0, atol=1e-9)
    wrong = chi + np.eye(10)[3] * 1e-3
    assert np.abs(reduced @ wrong).max() > 1e-3
    wrench = platform_regressor(motion, paper.robot.gravity) @ chi
    np.testing.assert_allclose(wrench, -np.einsum("nij,ni->nj", xi, swing.tensions), atol=1e-10)


def test_tensions_by_least_squares_are_those_of_the_motion(paper, swing):
    found, residual = tensions(paper, paper.robot.nominal, swing.motion)
    np.testing.assert_allclose(found, swing.tensions, atol=1e-9)
    np.testing.assert_allclose(residual, 0, atol=1e-9)


def test_accelerations_are_the_derivative_of_the_twists(paper, swing):
    start = Pose(swing.motion.positions[0], swing.motion.rotations[0])
    dense = simulate_free_motion(paper, paper.robot.nominal, start, np.zeros(6), np.arange(500) * 1e-3).motion
    slope = (dense.twists[:-4] - 8 * dense.twists[1:-3] + 8 * dense.twists[3:-1] - dense.twists[4:]) / 0.012
    np.testing.assert_allclose(dense.accelerations[2:-2], slope, atol=2e-5)
    again, held = accelerations(paper, paper.robot.nominal, swing.motion)
    np.testing.assert_allclose(again, swing.motion.accelerations, atol=1e-12)
    np.testing.assert_allclose(held, swing.tensions, atol=1e-12)


def test_the_step_is_small_enough_and_times_are_free(paper, swing):
    start = Pose(swing.motion.positions[0], swing.motion.rotations[0])
    uneven = np.array([0.0, 0.013, 0.5, 0.5021, 3.7])
    fine = simulate_free_motion(paper, paper.robot.nominal, start, np.zeros(6), uneven, step=1e-3).motion
    coarse = simulate_free_motion(paper, paper.robot.nominal, start, np.zeros(6), uneven).motion
    np.testing.assert_allclose(fine.positions, coarse.positions, atol=1e-6)
    np.testing.assert_allclose(fine.positions[2], swing.motion.positions[50], atol=1e-6)
    np.testing.assert_array_equal(coarse.t, uneven)


def test_time_need_not_begin_at_zero(paper, swing):
    start = Pose(swing.motion.positions[0], swing.motion.rotations[0])
    later = simulate_free_motion(paper, paper.robot.nominal, start, np.zeros(6), TIMES[:50] + 7.0)
    np.testing.assert_allclose(later.motion.positions, swing.motion.positions[:50], atol=1e-12)


def test_a_slack_cable_ends_the_motion(paper):
    body = paper.robot.nominal
    rest = pose_from_lengths(paper, body, np.array([1.32, 1.58, 1.99, 1.76]))  # k = 2: cable 4 holds 1.88 N/kg
    twist = 0.8 * modes(paper, body, rest).shapes[:, 1]
    found = simulate_free_motion(paper, body, rest.pose, twist, TIMES)
    assert found.slack_time is not None
    assert found.slack_cable == 4
    assert len(found.motion.t) == len(found.tensions) < 1001
    assert found.motion.t[-1] <= found.slack_time < found.motion.t[-1] + 0.01 + 1e-9
    assert found.tensions.min() > 0
    ahead = simulate_free_motion(paper, body, rest.pose, twist, np.array([0.0, found.slack_time - 1e-4]))
    assert 0 < ahead.tensions[-1, 3] < 0.05
    with pytest.raises(InfeasibleError, match="Cable 4 is slack at the start"):
        simulate_free_motion(paper, body, rest.pose, 2 * twist, TIMES)


def test_what_cannot_be_simulated_is_refused(paper, swing):
    body = paper.robot.nominal
    start = Pose(swing.motion.positions[0], swing.motion.rotations[0])
    with pytest.raises(InfeasibleError, match=r"would stretch cable \d by"):
        simulate_free_motion(paper, body, start, np.array([0, 0, 0.1, 0, 0, 0]), TIMES)
    with pytest.raises(SetupError, match="times must be finite and increase"):
        simulate_free_motion(paper, body, start, np.zeros(6), np.array([0.0, 0.1, 0.1]))
    nothing = Body(com=body.com, inertia=np.array([0.0361, 0.0361, 0.0, 0.0, 0.0, 0.0]) * np.nan)
    with pytest.raises(InfeasibleError, match="not a body"):
        simulate_free_motion(paper, nothing, start, np.zeros(6), TIMES[:10])


class SteadyForce(Effect):
    parameters = ("fx", "fz")

    def wrench(self, state, theta):
        force = state.twist * 0
        force[0], force[2] = theta[0], theta[1]
        return force


def test_a_wrench_enters_the_motion(paper, swing):
    """A steady vertical force through P is more gravity, less its torque: seen here through Newton's law."""
    body = paper.robot.nominal
    start = Pose(swing.motion.positions[0], swing.motion.rotations[0])
    pushed = Mechanism(paper.robot, (SteadyForce(),), [0.3, -0.2])
    found = simulate_free_motion(pushed, body, start, np.zeros(6), TIMES[:100])
    wrench = platform_regressor(found.motion, paper.robot.gravity) @ parameter_vector(body)
    xi = paper.structure_matrix(found.motion.positions, found.motion.rotations)
    rest = wrench + np.einsum("nij,ni->nj", xi, found.tensions)
    per_mass = np.array([0.3, 0, -0.2, 0, 0, 0]) / paper.robot.mass
    np.testing.assert_allclose(rest, np.tile(per_mass, (100, 1)), atol=1e-10)
