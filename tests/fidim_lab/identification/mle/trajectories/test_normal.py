"""Residuals, their derivatives, and the small normal equations against dense ones."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fidim_lab.identification.mle.starts.start import as_states, first_guess
from fidim_lab.identification.mle.trajectories.likelihood import Likelihood, Point, linearised, simulate, stepped
from fidim_lab.identification.mle.trajectories.normal import Prior, reduced, step, tables_of
from fidim_lab.identification.mle.trajectories.recordings import prepare
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.grid import FINE


def gappy(window):
    """A marker lost for a while, single coordinates missing, one encoder silent, uneven times."""
    markers, lengths = window.markers.copy(), window.lengths.copy()
    markers[20:45, 0] = np.nan
    markers[60, -1, 1] = np.nan
    lengths[:, 1] = np.nan
    kept = np.delete(np.arange(len(window.t)), [3, 50, 51, 52, 90])
    return replace(window, t=window.t[kept] + 5.0, markers=markers[kept], lengths=lengths[kept])


@pytest.fixture(scope="module")
def problem(robot_with, record):
    robot = robot_with(3)
    windows = record(robot, 2, seconds=1.0, markers=2)
    windows[1] = gappy(windows[1])
    mechanism, body = Mechanism(robot), robot.nominal
    recordings = tuple(prepare(window, robot) for window in windows)
    guesses = as_states([first_guess(mechanism, body, recording) for recording in recordings])
    likelihood = Likelihood(mechanism, recordings, guesses, 1e-4, 2e-5)
    return likelihood, Point(body.vector, guesses), np.array([1.0, 0.8])


def test_gaps_give_no_residuals(problem):
    likelihood, point, ends = problem
    simulation = simulate(likelihood, point, ends, FINE)
    first, second = simulation.residuals
    assert len(first.markers) == 101 * 6
    assert len(first.lengths) == 3
    seen = np.isfinite(likelihood.recordings[1].markers[likelihood.recordings[1].t <= 0.8]).sum()
    assert len(second.markers) == seen
    assert len(second.lengths) == 2
    assert simulation.cost == pytest.approx(sum(float(r.rows @ r.rows) for r in simulation.residuals))


def test_all_rows_agree_with_finite_differences(problem):
    likelihood, point, ends = problem
    simulation = simulate(likelihood, point, ends, FINE)
    linear = {window.window: window for window in linearised(likelihood, simulation)}
    own, h = likelihood.own, 1e-6
    for column in range(own + 9):
        rows = []
        for sign in (h, -h):
            change = sign * np.eye(own + 9)[column]
            there = stepped(likelihood, simulation, np.tile(change[:own], (2, 1)), change[own:])
            rows.append([r.rows for r in simulate(likelihood, there, ends, FINE).residuals])
        for w in range(2):
            slope = (rows[0][w] - rows[1][w]) / (2 * h)
            exact = np.hstack([linear[w].by_own, linear[w].by_shared])[:, column]
            scale = max(1.0, np.abs(slope).max())
            loose = slice(None, -own) if column < 6 else slice(None)  # turns of the loose prior are linear only nearby
            np.testing.assert_allclose(exact[loose], slope[loose], atol=1e-5 * scale, err_msg=f"{w} {column}")
            np.testing.assert_allclose(linear[w].residual, simulation.residuals[w].rows)


def dense(tables, own):
    """All tables as one matrix of all unknowns, own ones first, and the right-hand side."""
    count, size = tables.shape[:2]
    matrix = np.zeros((count * size, count * own + size - own - 1))
    for w, table in enumerate(tables):
        matrix[w * size : (w + 1) * size, w * own : (w + 1) * own] = table[:, :own]
        matrix[w * size : (w + 1) * size, count * own :] = table[:, own:-1]
    return matrix, tables[:, :, -1].ravel()


@pytest.mark.parametrize("damping", [1e-9, 0.1])
@pytest.mark.parametrize("held", [False, True])
def test_steps_are_those_of_the_dense_problem(problem, damping, held):
    likelihood, point, ends = problem
    simulation = simulate(likelihood, point, ends, FINE)
    windows = linearised(likelihood, simulation)
    tables, own = tables_of(likelihood, simulation), likelihood.own
    for window in windows:
        whole = np.column_stack([window.by_own, window.by_shared, window.residual])
        table = tables[window.window]
        np.testing.assert_allclose(table.T @ table, whole.T @ whole, rtol=1e-9, atol=1e-6)
    prior = Prior(mean=point.shared + 0.01, sd=np.full(9, 0.1))
    free = np.full(9, not held)
    found = step(tables, own, prior.rows(point.shared), damping, free)
    matrix, right = dense(tables, own)
    rows = prior.rows(point.shared)
    matrix = np.vstack([matrix, np.hstack([np.zeros((9, 2 * own)), rows[:, :-1]])])
    right = np.append(right, rows[:, -1])
    ridge = np.diag(np.sqrt(damping) * np.linalg.norm(matrix, axis=0))
    use = np.concatenate([np.full(2 * own, True), free])
    wanted = np.zeros(matrix.shape[1])
    stacked = np.vstack([matrix, ridge])[:, use]
    wanted[use] = np.linalg.lstsq(stacked, -np.append(right, np.zeros(len(ridge))), rcond=None)[0]
    np.testing.assert_allclose(found.own.ravel(), wanted[: 2 * own], atol=1e-6 * np.abs(wanted).max())
    np.testing.assert_allclose(found.shared, wanted[2 * own :], atol=1e-6 * max(np.abs(wanted).max(), 1e-3))
    left = right + matrix @ wanted
    assert found.predicted == pytest.approx(left @ left, rel=1e-6)


def test_reduced_tables_are_the_schur_complement(problem):
    likelihood, point, ends = problem
    tables = tables_of(likelihood, simulate(likelihood, point, ends, FINE))
    own = likelihood.own
    for table, small in zip(tables, reduced(tables, own), strict=True):
        normal = table.T @ table
        schur = normal[own:, own:] - normal[own:, :own] @ np.linalg.solve(normal[:own, :own], normal[:own, own:])
        np.testing.assert_allclose(small.T @ small, schur, rtol=1e-6, atol=1e-6 * np.abs(schur).max())


def test_a_body_that_cannot_move_is_not_simulated(problem):
    likelihood, point, ends = problem
    shared = point.shared.copy()
    shared[3:6] = 1e-3
    assert simulate(likelihood, Point(shared, point.states), ends, FINE) is None


def test_the_first_guess_is_near(problem, truth):
    likelihood = problem[0]
    robot = likelihood.mechanism.robot
    guess = first_guess(likelihood.mechanism, truth(robot), likelihood.recordings[0])
    assert guess.misfit < 1e-3
    arm = Rotation.from_matrix(guess.rotation).apply(robot.markers[0])
    np.testing.assert_allclose(guess.position + arm, likelihood.recordings[0].markers[0, 0], atol=5e-4)
    xi = likelihood.mechanism.structure_matrix(guess.position[None], guess.rotation[None])[0]
    np.testing.assert_allclose(xi @ guess.twist, 0, atol=1e-12)
