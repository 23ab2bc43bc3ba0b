"""Windows that share nothing, optimised side by side: each as if it were alone."""

from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.effects.cables.cable_elasticity import CableStiffness
from fidim_lab.errors import RefusedError
from fidim_lab.identification.mle.fit import likelihood_of
from fidim_lab.identification.mle.held_out import HeldOutPrediction, predict, predict_all
from fidim_lab.identification.mle.starts.start import first_guess, first_guesses
from fidim_lab.identification.mle.trajectories.likelihood import Point, simulate
from fidim_lab.identification.mle.trajectories.normal import Prior, own_steps, step
from fidim_lab.identification.mle.trajectories.optimise import DAMPING, ON_THE_WAY, creeps, optimise
from fidim_lab.identification.mle.trajectories.per_window import optimise_apart
from fidim_lab.identification.mle.trajectories.recordings import prepare
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.grid import FINE
from fidim_lab.model.sensitivity.starts import tied


@pytest.fixture(scope="module")
def recorded(robot_with, record):
    robot = robot_with(4)
    return robot, [prepare(window, robot) for window in record(robot, 3, seconds=1.0)]


def test_first_guesses_are_those_of_each_window_alone(recorded):
    robot, recordings = recorded
    mechanism = Mechanism(robot)
    blind = replace(recordings[1], markers=np.full_like(recordings[1].markers, np.nan))
    found = first_guesses(mechanism, robot.nominal, [recordings[0], blind, recordings[2]])
    assert isinstance(found[1], RefusedError)
    for guess, recording in ((found[0], recordings[0]), (found[2], recordings[2])):
        alone = first_guess(mechanism, robot.nominal, recording)
        np.testing.assert_allclose(guess.rotation, alone.rotation, atol=1e-9)
        np.testing.assert_allclose(guess.twist, alone.twist, atol=1e-9)


def test_side_by_side_each_window_ends_where_it_ends_alone(recorded):
    robot, recordings = recorded
    mechanism, shared = Mechanism(robot), robot.nominal.vector
    held, prior = np.zeros(9, dtype=bool), Prior(shared, np.full(9, np.inf))
    guesses = [first_guess(mechanism, robot.nominal, recording) for recording in recordings]
    likelihood = likelihood_of(mechanism, shared, tuple(recordings), guesses, robot.sensors)
    together = optimise_apart(likelihood, Point(shared, likelihood.guesses), np.full(3, 1.0), ON_THE_WAY)
    costs = []
    for recording, guess in zip(recordings, guesses, strict=True):
        one = likelihood_of(mechanism, shared, (recording,), [guess], robot.sensors)
        alone = optimise(one, Point(shared, one.guesses), np.ones(1), prior, ON_THE_WAY, held)
        costs.append(alone.cost)
    assert together.ending.settled
    assert together.cost == pytest.approx(sum(costs), rel=1e-9)
    assert together.cost == pytest.approx(together.simulation.cost, rel=1e-9)


def test_steps_of_windows_that_share_nothing_are_those_with_all_shared_parameters_held():
    tables = np.stack([np.triu(np.random.default_rng(k).normal(size=(18, 18))) for k in range(2)])
    prior = Prior(np.zeros(9), np.full(9, np.inf)).rows(np.zeros(9))
    wanted = step(tables, 8, prior, 0.1, np.zeros(9, dtype=bool))
    steps, predicted = own_steps(tables, 8, np.full(2, 0.1))
    np.testing.assert_allclose(steps, wanted.own, rtol=1e-9)
    assert predicted.sum() == pytest.approx(wanted.predicted)


def test_one_window_that_contradicts_its_lengths_leaves_the_others_be(recorded):
    robot, recordings = recorded
    mechanism, shared = Mechanism(robot), robot.nominal.vector
    wrong = replace(recordings[1], lengths=recordings[1].lengths + 2.0)
    found = predict_all(mechanism, shared, [recordings[0], wrong, recordings[2]], robot.sensors)
    assert isinstance(found[1], RefusedError)
    assert wrong.window.id in str(found[1])
    for prediction, recording in ((found[0], recordings[0]), (found[2], recordings[2])):
        assert isinstance(prediction, HeldOutPrediction)
        alone = predict(mechanism, shared, recording, robot.sensors)
        assert prediction.remainder.chi2 == pytest.approx(alone.remainder.chi2, rel=1e-6)


def test_windows_go_on_where_one_of_them_finds_no_better_state(recorded):
    robot, recordings = recorded
    mechanism, shared = Mechanism(robot), robot.nominal.vector
    guesses = [first_guess(mechanism, robot.nominal, recording) for recording in recordings]
    likelihood = likelihood_of(mechanism, shared, tuple(recordings), guesses, robot.sensors)
    start, ends = Point(shared, likelihood.guesses), np.full(3, 1.0)
    best = optimise_apart(likelihood, start, ends, replace(ON_THE_WAY, promise=1e-6))
    mixed = start.states.with_one(0, best.simulation.point.states, 0)  # the first is at its best already
    last_try = replace(ON_THE_WAY, promise=0.0, damping=DAMPING[1], rounds=2)
    found = optimise_apart(likelihood, Point(shared, mixed), ends, last_try)
    before = simulate(likelihood, Point(shared, mixed), ends, ON_THE_WAY.resolution)
    assert found.cost < before.cost
    assert found.simulation.residuals[0].rows == pytest.approx(before.residuals[0].rows)


def test_a_window_too_quick_for_its_blocks_gets_shorter_ones_alone(recorded):
    robot, recordings = recorded
    stiff = Mechanism(robot, (CableStiffness(),), [2e-6], springs=True, quiet=True)
    shared = np.concatenate([robot.nominal.vector, stiff.theta])
    guesses = [first_guess(Mechanism(robot), robot.nominal, recording) for recording in recordings]
    likelihood = likelihood_of(stiff, shared, tuple(recordings), guesses, robot.sensors)
    held, ends = likelihood.guesses, np.full(3, 1.0)
    quick = replace(held, twists=held.twists * np.array([[1.0], [30.0], [1.0]]))
    states = tied(stiff, shared, replace(quick, tensions=None), likelihood.begins)
    with np.errstate(all="ignore"):  # as where it is asked for: a motion may have no solution
        found = simulate(likelihood, Point(shared, states), ends, FINE)
    assert found is not None
    usual, finer = found.batches
    assert usual.members.tolist() == [0, 2]
    assert finer.members.tolist() == [1]
    assert finer.trajectories.grid.resolution.block < usual.trajectories.grid.resolution.block
    finest = simulate(likelihood, Point(shared, states), ends, replace(FINE, block=FINE.block / 8))
    assert finest is not None
    for one, other in zip(found.residuals, finest.residuals, strict=True):
        np.testing.assert_allclose(one.markers, other.markers, atol=0.3)  # of a standard deviation


@pytest.mark.parametrize(
    ("costs", "given_up"),
    [
        ([300.0, 242.0, 240.0, 239.0], True),  # misses by more than noise, and hardly gets nearer
        ([300.0, 242.0, 240.0, 230.0], False),
        ([3000.0, 2900.0, 2850.0, 2800.0], True),  # so far astray that more is asked for
        ([3000.0, 2600.0, 2300.0, 1800.0], False),
        ([101.0, 100.5, 100.3, 100.2], False),  # of noise the last of it is wanted
    ],
)
def test_a_fit_that_will_hardly_leave_noise_must_keep_its_pace(costs, given_up):
    effort = replace(ON_THE_WAY, creep=0.1, crawl=0.01)
    assert creeps(costs, 100, effort) is given_up
    assert not creeps(costs, 100, ON_THE_WAY)
