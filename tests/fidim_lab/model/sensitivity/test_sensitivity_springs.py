"""Cables that are springs: against the other integrator, against finite differences, and where nearly rigid."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from benchmarks.identification.elastic_motion import simulate_elastic_motion
from fidim_lab.data.records import Body, Pose
from fidim_lab.model.kinematics import equilibrium_at, pose_from_lengths
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity import markers
from fidim_lab.model.sensitivity.equations import EASE
from fidim_lab.model.sensitivity.grid import FINE, LARGEST_PHASE, QUICK, Grid
from fidim_lab.model.sensitivity.integrate import States, integrate
from fidim_lab.model.sensitivity.starts import linearised_starts, moved, own_count, quiet_springs, tied
from fidim_lab.model.sensitivity.variation import variations
from fidim_lab.model.slots import Effect

MARKERS = np.array([[0.02, -0.03, 0.05], [0.2, 0.1, 0.15]])
BEGINS = np.array([0.0, 0.4])
TIMES = np.array([0.0, 0.0137, 0.1, 0.25, 0.333, 0.4])


class Soft(Effect):
    """All cables, or some, stretch by θ metres a newton; the first creeps; air drags."""

    parameters = ("softness", "drag", "creep")

    def __init__(self, numbers=(1, 2, 3, 4, 5)):
        self.numbers = numbers

    def compliance(self, number, cable, theta):
        return theta[0] if number in self.numbers else super().compliance(number, cable, theta)

    def stretch_damping(self, number, theta):
        return ca.SX(40.0)

    def wrench(self, state, theta):
        return -theta[1] * state.twist

    def length_drift(self, number, time, theta):
        return theta[2] * time if number == 1 else super().length_drift(number, time, theta)


class Yielding(Soft):
    encoder_sees_stretch = True


class Rubbing(Soft):
    """What drags at the attachments goes with the tension, too, as dry friction does."""

    def tension_wrench(self, number, state, theta):
        arm = state.cables[number - 1].arm
        force = -0.1 * theta[1] * state.velocity(arm)
        return ca.vertcat(force, ca.cross(arm, force))


def started(robot, effect, softness=2e-5, shake=0.05) -> tuple[Mechanism, np.ndarray, States]:
    """Two windows of one robot near rest, their springs shaken."""
    mechanism = Mechanism(robot, (effect,), [softness, 0.3, 1e-3], springs=True)
    body, rigid = robot.nominal, Mechanism(robot)
    if robot.n >= 4:
        place = np.array([1.25, -0.15, -0.2] if robot.n == 4 else [-0.1, -0.1, -0.1])
        rest = equilibrium_at(rigid, body, place).pose
    else:
        rest = pose_from_lengths(rigid, body, np.full(robot.n, 1.3)).pose
    rng = np.random.default_rng(robot.n)
    shared = np.concatenate([body.vector, mechanism.theta])
    pose = (np.tile(rest.position, (2, 1)), np.tile(rest.rotation, (2, 1, 1)))
    swinging = tied(rigid, body.vector, States(*pose, 0.2 * rng.normal(size=(2, 6))), BEGINS)
    quiet = tied(mechanism, shared, swinging, BEGINS)
    tensions = quiet.tensions * (1 + shake * rng.normal(size=quiet.tensions.shape))
    shaken = replace(quiet, tensions=tensions, twists=quiet.twists + shake / 10 * rng.normal(size=(2, 6)))
    return mechanism, shared, tied(mechanism, shared, shaken, BEGINS)


@pytest.fixture(scope="module", params=[1, 2, 3, 4, 5])
def robot(request, make_robot, paper):
    return paper.robot if request.param == 4 else make_robot(request.param)


def simulated(mechanism, shared, states, resolution=FINE, seconds=0.4):
    fine = resolution.for_frequency(quiet_springs(mechanism, shared, states, BEGINS).fastest)
    starts = linearised_starts(mechanism, shared, states, BEGINS)
    grid = Grid.covering(seconds, fine)
    return starts, integrate(mechanism, shared, states, grid, BEGINS, starts.unstretched)


def predicted(mechanism, shared, states, resolution=FINE):
    _, trajectories = simulated(mechanism, shared, states, resolution)
    index, weights = markers.hermite(trajectories.grid.t, TIMES)
    return np.stack([markers.between(one, index, weights) for one in markers.at_nodes(trajectories, MARKERS)])


def derivatives(mechanism, shared, states, resolution=FINE, times=TIMES):
    starts, trajectories = simulated(mechanism, shared, states, resolution, times[-1])
    by = variations(mechanism, trajectories, shared, starts.states_by, unstretched=starts.unstretched_by)
    alone = starts.by_own(own := starts.states_by.shape[2] - len(shared))
    held = variations(mechanism, trajectories, shared, alone.states_by, unstretched=alone.unstretched_by, held=True)
    assert held.poses == pytest.approx(by.poses[..., :own])
    assert held.accelerations == pytest.approx(by.accelerations[..., :own])
    index, weights = markers.hermite(trajectories.grid.t, times)
    nodal = markers.varied_at_nodes(trajectories, by, MARKERS)
    return starts, np.stack([markers.between(one, index, weights) for one in nodal])


@pytest.mark.parametrize("effect", [Soft(), Rubbing()], ids=["all", "rubbing"])
def test_springs_move_as_with_the_other_integrator(robot, effect):
    mechanism, shared, states = started(robot, effect)
    starts, found = simulated(mechanism, shared, states)
    for w in range(2):
        times = found.grid.t + BEGINS[w]
        pose = Pose(states.positions[w], states.rotations[w])
        given = (Body.from_vector(shared), pose, states.twists[w], times, starts.unstretched[w])
        other = simulate_elastic_motion(mechanism, *given, step=1e-3)
        valid = len(other.motion.t)  # a single cable may be shaken slack
        assert valid > len(times) / 2
        np.testing.assert_allclose(found.positions[w][:valid], other.motion.positions, atol=1e-6)
        np.testing.assert_allclose(found.rotations[w][:valid], other.motion.rotations, atol=1e-5)
        np.testing.assert_allclose(found.tensions[w][:valid], other.tensions, atol=2e-3)


@pytest.mark.parametrize(
    "effect", [Soft(), Soft((2,)), Yielding((1, 2)), Rubbing()], ids=["all", "one", "seen", "rubbing"]
)
@pytest.mark.sampled(8)
def test_every_column_agrees_with_finite_differences(robot, effect):
    if robot.n == 1 and effect.numbers == (2,):
        pytest.skip("a robot of one cable has no second one")
    mechanism, shared, states = started(robot, effect)
    starts, exact = derivatives(mechanism, shared, states)
    own = own_count(mechanism)
    assert exact.shape == (2, len(TIMES), 2, 3, own + len(shared))
    sizes = np.concatenate([np.full(own, 1e-6), np.full(9, 1e-6), [1e-10, 1e-6, 1e-7]])
    for column, h in enumerate(sizes):
        ends, lengths, rates = [], [], []
        for sign in (h, -h):
            step = sign * np.eye(len(sizes))[column]
            there = shared + step[own:]
            at = moved(mechanism, there, states, starts, np.tile(step[:own], (2, 1)), BEGINS)
            now = linearised_starts(mechanism, there, at, BEGINS)
            ends.append(predicted(mechanism, there, at))
            lengths.append(np.concatenate([now.lengths, now.unstretched], axis=1))
            rates.append(now.rates)
        slope, by_length, by_rate = ((x[0] - x[1]) / (2 * h) for x in (ends, lengths, rates))
        found = np.concatenate([starts.lengths_by, starts.unstretched_by], axis=1)[..., column]
        for name, value, wanted in (
            ("markers", exact[..., column], slope),
            ("lengths", found, by_length),
            ("rates", starts.rates_by[..., column], by_rate),
        ):
            scale = max(1.0, np.abs(wanted).max())
            np.testing.assert_allclose(value, wanted, atol=2e-5 * scale, err_msg=f"{name}, column {column}")


def test_the_quick_grid_is_good_enough_for_stiff_springs(paper):
    mechanism, shared, states = started(paper.robot, Soft(), softness=1e-6)
    fastest = quiet_springs(mechanism, shared, states, BEGINS).fastest
    assert QUICK.for_frequency(fastest).block < QUICK.block
    assert QUICK.for_frequency(fastest).block * fastest <= LARGEST_PHASE
    quick, fine = (derivatives(mechanism, shared, states, r)[1] for r in (QUICK, FINE))
    error = np.abs(quick - fine).max(axis=(0, 1, 2, 3)) / np.abs(fine).max(axis=(0, 1, 2, 3))
    assert error.max() < 2e-3
    motions = [predicted(mechanism, shared, states, r) for r in (QUICK, FINE)]
    np.testing.assert_allclose(*motions, atol=1e-8)


def test_slack_springs_cost_single_columns_some_per_cent_and_standard_deviations_nothing(paper):
    """A cable that gets slack is a kink within a block of collocation; blocks sixteen times finer show its cost."""
    mechanism, shared, states = started(paper.robot, Soft(), shake=0.3)
    states = tied(mechanism, shared, replace(states, twists=5 * states.twists), BEGINS)
    times = np.linspace(0, 1.2, 60)
    tensions = simulated(mechanism, shared, states, seconds=1.2)[1].tensions
    assert tensions.min() < EASE / 10
    usual, finest = (
        derivatives(mechanism, shared, states, r, times)[1] for r in (FINE, replace(FINE, block=FINE.block / 16))
    )
    error = np.linalg.norm((usual - finest).reshape(-1, usual.shape[-1]), axis=0)
    error /= np.linalg.norm(finest.reshape(-1, usual.shape[-1]), axis=0)
    assert error.max() < 0.15
    assert np.median(error) < 2e-3
    own = own_count(mechanism)
    ratio = bodys_sd(usual[0], own) / bodys_sd(finest[0], own)
    np.testing.assert_allclose(ratio, 1.0, atol=0.005)


def bodys_sd(by: np.ndarray, own: int) -> np.ndarray:
    """Standard deviations of the body by one window with 0.1 mm of noise and a prior of 1 on everything."""
    columns = by.reshape(-1, by.shape[-1]) / 1e-4
    return np.sqrt(np.diag(np.linalg.inv(columns.T @ columns + np.eye(columns.shape[1]))))[own : own + 9]


def test_the_stiffer_the_springs_the_more_they_are_rigid(paper):
    """Quiet springs follow the rigid motion, and the difference falls in proportion to the compliance."""
    rigid = Mechanism(paper.robot)
    apart = []
    for softness in (4e-7, 1e-7):
        mechanism, shared, states = started(paper.robot, Soft(), softness, shake=0.0)
        mechanism = Mechanism(paper.robot, mechanism.effects, [softness, 0.0, 0.0], springs=True)
        shared[-2:] = 0.0
        held = tied(rigid, shared[:9], replace(states, tensions=None), BEGINS)
        quiet = tied(mechanism, shared, replace(held, tensions=None), BEGINS)
        other = integrate(rigid, shared[:9], held, Grid.covering(0.4, FINE), BEGINS)
        index, weights = markers.hermite(other.grid.t, TIMES)
        there = np.stack([markers.between(one, index, weights) for one in markers.at_nodes(other, MARKERS)])
        apart.append(np.abs(predicted(mechanism, shared, quiet) - there).max())
    assert apart[0] < 1e-4
    assert apart[1] == pytest.approx(apart[0] / 4, rel=0.2)
