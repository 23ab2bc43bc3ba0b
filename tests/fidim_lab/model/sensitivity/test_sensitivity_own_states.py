"""Trajectories of effects with states of their own: against the other integrator, and finite differences."""

from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.data.records import Pose
from fidim_lab.effects.loads.loose_mass import LooseMass
from fidim_lab.model.kinematics import pose_from_lengths
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion import simulate_free_motion
from fidim_lab.model.sensitivity import markers
from fidim_lab.model.sensitivity.grid import FINE, Grid
from fidim_lab.model.sensitivity.integrate import States, integrate
from fidim_lab.model.sensitivity.starts import linearised_starts, moved, own_count, tied
from fidim_lab.model.sensitivity.variation import variations

BEGINS = np.zeros(2)
THETA = [0.4, 2.2, 0.1, 0.05, -0.04, 0.12]
MARKERS = np.array([[0.0, 0.0, 0.0], [0.1, -0.2, 0.05]])
TIMES = np.linspace(0.013, 0.59, 9)


@pytest.fixture(scope="module")
def started(paper):
    mechanism = Mechanism(paper.robot, (LooseMass(),), THETA)
    body = paper.robot.nominal
    rest = pose_from_lengths(Mechanism(paper.robot), body, np.array([1.38, 1.39, 1.36, 1.32])).pose
    rng = np.random.default_rng(3)
    states = States(
        positions=rest.position + 0.01 * rng.normal(size=(2, 3)),
        rotations=np.tile(rest.rotation, (2, 1, 1)),
        twists=0.15 * rng.normal(size=(2, 6)),
        astray=np.array([0.005, 0.005, 0.005, 0.02, 0.02, 0.02]) * rng.normal(size=(2, 6)),
    )
    shared = np.concatenate([body.vector, mechanism.theta])
    return mechanism, shared, tied(mechanism, shared, states, BEGINS)


def run(mechanism, shared, states):
    starts = linearised_starts(mechanism, shared, states, BEGINS)
    return starts, integrate(
        mechanism, shared, states, Grid.covering(0.6, FINE), BEGINS, starts.unstretched, starts.extra
    )


def places(found):
    index, weights = markers.hermite(found.grid.t, TIMES)
    return np.stack([markers.between(one, index, weights) for one in markers.at_nodes(found, MARKERS)])


def test_a_loose_mass_moves_as_in_the_other_integrator(started):
    mechanism, shared, states = started
    starts, found = run(mechanism, shared, states)
    for w in range(2):
        pose = Pose(states.positions[w], states.rotations[w])
        other = simulate_free_motion(
            mechanism, mechanism.robot.nominal, pose, states.twists[w], found.grid.t, step=2e-3, extra=starts.extra[w]
        )
        np.testing.assert_allclose(found.positions[w], other.motion.positions, atol=1e-8)
        np.testing.assert_allclose(found.extra[w], other.extra_states, atol=2e-7)
        np.testing.assert_allclose(found.tensions[w], other.tensions, atol=1e-5)


def test_a_window_that_is_lost_on_the_way_leaves_the_others_their_derivatives(started):
    mechanism, shared, states = started
    starts, found = run(mechanism, shared, states)
    whole = variations(mechanism, found, shared, starts.states_by)
    kept = np.arange(found.positions.shape[1]) < 12
    motion = {name: getattr(found, name).copy() for name in ("positions", "rotations", "twists", "extra")}
    for values in motion.values():
        values[0, ~kept] = np.nan
    lost = replace(found, **motion)
    by = variations(mechanism, lost, shared, starts.states_by)
    np.testing.assert_array_equal(by.poses[1], whole.poses[1])
    assert np.isnan(by.poses[0, -1]).any()
    np.testing.assert_array_equal(by.poses[0, :9], whole.poses[0, :9])
    t = found.grid.t
    assert not lost.breaks_down(0, t[8])
    assert lost.breaks_down(0, t[11])  # it is known there, and its derivatives, of a whole block, are not
    assert not lost.breaks_down(1, t[-1])


def test_every_column_agrees_with_finite_differences(started):
    mechanism, shared, states = started
    own = own_count(mechanism)
    assert own == 6 + mechanism.freedoms + 6
    starts, found = run(mechanism, shared, states)
    by = variations(mechanism, found, shared, starts.states_by)
    index, weights = markers.hermite(found.grid.t, TIMES)
    nodal = markers.varied_at_nodes(found, by, MARKERS)
    exact = np.stack([markers.between(one, index, weights) for one in nodal])
    h = 1e-6
    for column in range(own + len(shared)):
        ends, loose = [], []
        for sign in (h, -h):
            step = sign * np.eye(own + len(shared))[column]
            there = shared + step[own:]
            at = moved(mechanism, there, states, starts, np.tile(step[:own], (2, 1)), BEGINS)
            motion = run(mechanism, there, at)[1]
            ends.append(places(motion))
            loose.append(motion.extra)
        slope, drift = ((side[0] - side[1]) / (2 * h) for side in (ends, loose))
        scale = max(1.0, np.abs(slope).max())
        np.testing.assert_allclose(exact[..., column], slope, atol=3e-6 * scale, err_msg=f"column {column}")
        scale = max(1.0, np.abs(drift).max())
        np.testing.assert_allclose(by.extra[..., column], drift, atol=2e-5 * scale, err_msg=f"column {column}")


def test_a_window_that_takes_a_better_state_takes_the_own_states_too(started):
    _, _, states = started
    nowhere = replace(states, astray=None)
    taken = nowhere.with_one(1, states.of(np.array([1])), 0)
    np.testing.assert_array_equal(taken.astray, [np.zeros(6), states.astray[1]])
    np.testing.assert_array_equal(states.with_one(0, nowhere, 1).astray, states.astray)
