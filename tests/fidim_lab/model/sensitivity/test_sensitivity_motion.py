"""Trajectories against the other integrator, their derivatives against finite differences, any number of cables."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fidim_lab.data.records import Body, Pose
from fidim_lab.errors import OurBugError
from fidim_lab.model.kinematics import equilibrium_at, pose_from_lengths
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.modes import modes
from fidim_lab.model.motion import simulate_free_motion
from fidim_lab.model.sensitivity import markers
from fidim_lab.model.sensitivity.grid import FINE, QUICK, Grid
from fidim_lab.model.sensitivity.integrate import States, integrate
from fidim_lab.model.sensitivity.starts import linearised_starts, moved, tied
from fidim_lab.model.sensitivity.variation import variations
from fidim_lab.model.slots import Effect, ExtraState

MARKERS = np.array([[0.02, -0.03, 0.05], [0.2, 0.1, 0.15]])
BEGINS = np.array([0.0, 0.4])
TIMES = np.array([0.0, 0.0137, 0.1, 0.25, 0.333, 0.59, 0.6])
TIMES_TO_SLACKNESS = np.arange(201) / 100


class Everything(Effect):
    """A force along x that grows in time, drag, an anchor that is off, a cable that creeps, a mass that moves along."""

    parameters = ("force", "drag", "offset", "longer", "creep", "mass")

    def geometry(self, number, cable, theta):
        if number > 1:
            return cable
        return replace(cable, d=cable.d + theta[2] * np.array([0, 1.0, 0]))

    def cable_length(self, number, theta):
        return theta[3] * number

    def wrench(self, state, theta):
        force = -theta[1] * state.twist
        force[0] += theta[0] * (state.time + 0.3) ** 2
        return force

    def length_drift(self, number, time, theta):
        return theta[4] * number * (1 - ca.exp(-time / 3))

    def kinetic_energy(self, state, theta):
        return theta[5] / 2 * ca.sumsqr(state.velocity(state.arm([0.1, 0.0, 0.2])))


def started(robot, effects=(), theta=None, kick=0.15) -> tuple[Mechanism, np.ndarray, States]:
    """Two windows of one robot, let go from rest poses turned in different ways."""
    mechanism = Mechanism(robot, effects, theta)
    body = robot.nominal
    lengths = np.full(robot.n, 1.3)
    if robot.n == 4:
        lengths = np.array([1.38, 1.39, 1.36, 1.32])
    if robot.n == 5:
        lengths = equilibrium_at(Mechanism(robot), body, np.array([-0.1, -0.1, -0.1])).lengths
    rest = pose_from_lengths(Mechanism(robot), body, lengths).pose
    rng = np.random.default_rng(robot.n)
    states = States(
        positions=rest.position + 0.01 * rng.normal(size=(2, 3)),
        rotations=rest.rotation @ Rotation.from_rotvec(0.02 * rng.normal(size=(2, 3))).as_matrix(),
        twists=kick * rng.normal(size=(2, 6)),
    )
    shared = np.concatenate([body.vector, mechanism.theta])
    return mechanism, shared, tied(mechanism, shared, states, BEGINS)


@pytest.fixture(scope="module", params=[1, 2, 3, 4, 5])
def robot(request, make_robot, paper):
    return paper.robot if request.param == 4 else make_robot(request.param)


def test_trajectories_are_those_of_the_other_integrator(robot):
    mechanism, shared, states = started(robot)
    found = integrate(mechanism, shared, states, Grid.covering(1.0, FINE), np.zeros(2))
    for w in range(2):
        pose = Pose(states.positions[w], states.rotations[w])
        body = Body.from_vector(shared)
        other = simulate_free_motion(mechanism, body, pose, states.twists[w], found.grid.t, step=2e-3)
        assert other.slack_time is None
        np.testing.assert_allclose(found.positions[w], other.motion.positions, atol=1e-8)
        np.testing.assert_allclose(found.rotations[w], other.motion.rotations, atol=1e-8)
        np.testing.assert_allclose(found.accelerations[w], other.motion.accelerations, atol=2e-6)
        np.testing.assert_allclose(found.tensions[w], other.tensions, atol=1e-6)


def predicted(mechanism, shared, states, resolution=FINE):
    trajectories = integrate(mechanism, shared, states, Grid.covering(0.6, resolution), BEGINS)
    index, weights = markers.hermite(trajectories.grid.t, TIMES)
    nodal = markers.at_nodes(trajectories, MARKERS)
    return trajectories, np.stack([markers.between(one, index, weights) for one in nodal])


def derivatives(mechanism, shared, states, resolution=FINE):
    trajectories, _ = predicted(mechanism, shared, states, resolution)
    starts = linearised_starts(mechanism, shared, states, BEGINS)
    by = variations(mechanism, trajectories, shared, starts.states_by)
    index, weights = markers.hermite(trajectories.grid.t, TIMES)
    nodal = markers.varied_at_nodes(trajectories, by, MARKERS)
    return starts, np.stack([markers.between(one, index, weights) for one in nodal])


@pytest.mark.sampled(4)
@pytest.mark.parametrize("effects", [(), (Everything(),)], ids=["rigid", "with effects"])
def test_every_column_agrees_with_finite_differences(robot, effects):
    theta = [0.2, 0.3, 0.004, 1e-3, 2e-3, 0.4] if effects else None
    mechanism, shared, states = started(robot, effects, theta)
    starts, exact = derivatives(mechanism, shared, states)
    own = 6 + mechanism.freedoms
    assert exact.shape == (2, len(TIMES), 2, 3, own + len(shared))
    h = 1e-6
    for column in range(own + len(shared)):
        ends, lengths = [], []
        for sign in (h, -h):
            step = sign * np.eye(own + len(shared))[column]
            there = shared + step[own:]
            at = moved(mechanism, there, states, starts, np.tile(step[:own], (2, 1)), BEGINS)
            ends.append(predicted(mechanism, there, at)[1])
            lengths.append(linearised_starts(mechanism, there, at, BEGINS).lengths)
        slope = (ends[0] - ends[1]) / (2 * h)
        scale = max(1.0, np.abs(slope).max())
        np.testing.assert_allclose(exact[..., column], slope, atol=3e-6 * scale, err_msg=f"column {column}")
        by_length = (lengths[0] - lengths[1]) / (2 * h)
        np.testing.assert_allclose(starts.lengths_by[..., column], by_length, atol=1e-7, err_msg=f"column {column}")


def test_the_quick_grid_is_good_enough_on_the_way(paper):
    mechanism, shared, states = started(paper.robot, kick=0.3)
    quick, fine = (derivatives(mechanism, shared, states, r)[1] for r in (QUICK, FINE))
    error = np.abs(quick - fine).max(axis=(0, 1, 2, 3)) / np.abs(fine).max(axis=(0, 1, 2, 3))
    assert error.max() < 1e-3
    np.testing.assert_allclose(
        predicted(mechanism, shared, states, QUICK)[1], predicted(mechanism, shared, states)[1], atol=2e-7
    )


class Springy(Effect):
    parameters = ("kappa",)

    def compliance(self, number, cable, theta):
        return theta[0]


def test_the_derivative_by_a_compliance_is_exact_at_rigid_cables(paper):
    mechanism, shared, states = started(paper.robot, (Springy(),), [0.0])
    starts, exact = derivatives(mechanism, shared, states)
    h = 1e-8
    ends = []
    for sign in (h, -h):
        there = np.append(shared[:-1], sign)
        at = moved(mechanism, there, states, starts, np.zeros((2, 6 + mechanism.freedoms)), BEGINS)
        ends.append(predicted(mechanism, there, at)[1])
    slope = (ends[0] - ends[1]) / (2 * h)
    assert np.abs(slope).max() > 1
    np.testing.assert_allclose(exact[..., -1], slope, atol=1e-4 * np.abs(slope).max())


class Sloshing(Effect):
    parameters = ("size",)
    extra_states = (ExtraState("level", "m", 0.01),)

    def extra_rates(self, state, theta):
        return state.twist[2]

    def seen(self, point, state, theta):
        return point + state.extra[0]


def test_extra_states_that_cameras_see_change_are_refused(paper):
    _, shared, states = started(paper.robot)
    with pytest.raises(OurBugError, match=r"Sloshing: .* to the cameras"):
        integrate(
            Mechanism(paper.robot, (Sloshing(),)), np.append(shared, 0), states, Grid.covering(0.1, QUICK), BEGINS
        )


def test_tied_twists_stretch_no_cable_and_stay_near(paper):
    mechanism, shared, states = started(paper.robot)
    xi = mechanism.structure_matrix(states.positions, states.rotations)
    np.testing.assert_allclose(xi @ states.twists[..., None], 0, atol=1e-14)
    again = tied(mechanism, shared, states, BEGINS)
    np.testing.assert_allclose(again.twists, states.twists, atol=1e-15)


def test_a_lone_cable_spins_past_half_a_turn_with_its_derivatives(make_robot):
    """A chart of the rotation would end here."""
    mechanism = Mechanism(make_robot(1))
    body = mechanism.robot.nominal
    rest = pose_from_lengths(mechanism, body, np.array([1.3])).pose
    attachment = rest.rotation @ mechanism.robot.cables[0].a
    twist = np.concatenate([-np.cross([0, 0, 7.0], attachment), [0, 0, 7.0]])
    states = tied(mechanism, body.vector, States(rest.position[None], rest.rotation[None], twist[None]), np.zeros(1))
    starts = linearised_starts(mechanism, body.vector, states, np.zeros(1))
    found = integrate(mechanism, body.vector, states, Grid.covering(0.6, FINE), np.zeros(1))
    heading = np.unwrap(np.arctan2(found.rotations[0, :, 1, 0], found.rotations[0, :, 0, 0]))
    assert heading[-1] - heading[0] > 1.2 * np.pi
    by = variations(mechanism, found, body.vector, starts.states_by)
    step = np.zeros((1, 11))
    step[0, 8] = 1e-6
    ends = [
        integrate(
            mechanism,
            body.vector,
            moved(mechanism, body.vector, states, starts, s, np.zeros(1)),
            found.grid,
            np.zeros(1),
        )
        for s in (step, -step)
    ]
    slope = (ends[0].positions - ends[1].positions) / 2e-6
    np.testing.assert_allclose(by.poses[..., :3, 8], slope, atol=1e-5 * np.abs(slope).max())


def test_slackness_is_seen(paper):
    body = paper.robot.nominal
    rest = pose_from_lengths(paper, body, np.array([1.32, 1.58, 1.99, 1.76]))  # cable 4 holds 1.88 N/kg
    shape = modes(paper, body, rest).shapes[:, 1]
    twists = np.stack([0.1 * shape, 0.8 * shape])
    at = States(np.tile(rest.pose.position, (2, 1)), np.tile(rest.pose.rotation, (2, 1, 1)), twists)
    found = integrate(paper, body.vector, at, Grid.covering(2.0, QUICK), np.zeros(2))
    assert found.first_slack(0) is None
    other = simulate_free_motion(paper, body, rest.pose, twists[1], TIMES_TO_SLACKNESS)
    slack = found.first_slack(1)
    assert slack is not None
    assert slack == (pytest.approx(other.slack_time, abs=1e-3), 4)


def test_a_pose_inside_a_pulley_gives_nan_and_no_error(paper):
    mechanism, shared, states = started(paper.robot)
    cable = paper.robot.cables[0]
    inside = States(np.tile(cable.d - cable.a, (2, 1)), np.tile(np.eye(3), (2, 1, 1)), states.twists)
    found = integrate(mechanism, shared, inside, Grid.covering(0.2, QUICK), np.zeros(2))
    assert np.isnan(found.positions[:, -1]).all()
