"""Every derivative a descent uses, against central differences; and the design's expressions against the model's."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.data.records import Motion, Robot
from fidim_lab.errors import InfeasibleError, SetupError
from fidim_lab.identification.design import cost, limits
from fidim_lab.identification.design.information import information, judged, precision
from fidim_lab.identification.design.motions import Motions, Sensitive, simulate
from fidim_lab.identification.design.task import DesignTask
from fidim_lab.identification.design.windows import ReleasedWindow, place
from fidim_lab.model.equilibria import equilibrium_at
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion import conditioning, free_twist_basis, marker_selector
from fidim_lab.model.regressor import platform_regressor
from fidim_lab.model.sensitivity.grid import FINE

STEP = 2e-6
"""m, for differences; lengths and displacement alike"""


def moved(drawn, z: np.ndarray, near: tuple[ReleasedWindow, ...]) -> Motions:
    placed = [place(drawn.mechanism, drawn.task, one, other.resting) for one, other in zip(z, near, strict=True)]
    return simulate(drawn.mechanism, drawn.task, placed, FINE)


def central(
    drawn, z: np.ndarray, near: tuple[ReleasedWindow, ...], value: Callable[[Motions], np.ndarray]
) -> np.ndarray:
    """(W, …, z): of a quantity of each window by its own z."""
    columns = []
    for k in range(z.shape[1]):
        step = np.zeros(z.shape[1])
        step[k] = STEP
        columns.append((value(moved(drawn, z + step, near)) - value(moved(drawn, z - step, near))) / (2 * STEP))
    return np.stack(columns, axis=-1)


@pytest.fixture(scope="module")
def sensitive(drawn) -> Sensitive:
    placed = [place(drawn.mechanism, drawn.task, z) for z in drawn.pool.z[:3]]
    return Sensitive.of(drawn.mechanism, simulate(drawn.mechanism, drawn.task, placed, FINE))


def close(found: np.ndarray, wanted: np.ndarray, part: float = 2e-3) -> bool:
    return np.abs(found - wanted).max() <= part * np.abs(wanted).max()


def test_rest_and_start_follow_the_design(drawn):
    z = drawn.pool.z[0]
    at = place(drawn.mechanism, drawn.task, z)
    for k in range(len(z)):
        step = np.zeros(len(z))
        step[k] = 1e-6
        after, before = (place(drawn.mechanism, drawn.task, z + s * step, at.resting) for s in (1, -1))
        rest = (after.rest.position - before.rest.position) / 2e-6
        held = (after.held - before.held) / 2e-6
        turn = before.rest.rotation.T @ after.rest.rotation
        spin = at.rest.rotation @ np.array([turn[2, 1], turn[0, 2], turn[1, 0]]) / 2e-6
        assert np.concatenate([rest, spin, held]) == pytest.approx(at.rest_by[:, k], abs=1e-5 * abs(at.rest_by).max())
        start = (after.start.position - before.start.position) / 2e-6
        turn = before.start.rotation.T @ after.start.rotation
        spin = np.array([turn[2, 1], turn[0, 2], turn[1, 0]]) / 2e-6
        assert np.concatenate([start, spin]) == pytest.approx(at.start_by[:, k], abs=1e-5 * abs(at.start_by).max())


def test_gradient_of_the_papers_criterion(drawn, sensitive):
    motions = sensitive.motions
    found = cost.excitation(drawn.mechanism, sensitive)
    assert found.value == pytest.approx(cost.criterion(motions.regressors[:, motions.sampled].reshape(-1, 10)))
    z, near = drawn.pool.z[:3], motions.placed
    for w in range(3):
        for k in range(z.shape[1]):
            step = np.zeros_like(z)
            step[w, k] = STEP
            values = []
            for side in (1, -1):
                there = moved(drawn, z + side * step, near)
                values.append(cost.criterion(there.regressors[:, there.sampled].reshape(-1, 10)))
            slope = (values[0] - values[1]) / (2 * STEP)
            assert slope == pytest.approx(found.gradient[w, k], abs=2e-3 * np.abs(found.gradient).max())


def test_tensions_and_displacements_have_exact_slopes(drawn, sensitive):
    motions, n = sensitive.motions, drawn.task.robot.n
    z, near = drawn.pool.z[:3], motions.placed
    nodes = np.tile([7, 60, 110], (3, 1))
    rows = np.arange(3)[:, None]
    wanted = central(drawn, z, near, lambda m: np.dstack([m.tensions[rows, nodes], m.displacements[rows, nodes]]))
    for cable in range(n):
        weights = np.zeros((3, 3, n))
        weights[..., cable] = 1.0
        by = sensitive.at_nodes(drawn.mechanism, nodes, sensitive.weighted(tensions=weights))
        assert close(by, wanted[:, :, cable])
    assert close(sensitive.displacements_by()[rows, nodes], wanted[:, :, n:])


def test_limits_and_their_slopes_agree_with_differences(drawn, sensitive):
    """Peaks stay at their node for small steps, so the worst of each half second is differentiable."""
    z, near = drawn.pool.z[:3], sensitive.motions.placed

    def values(motions: Motions) -> np.ndarray:
        return limits.linearised(drawn.mechanism, Sensitive.of(drawn.mechanism, motions)).values

    found = limits.linearised(drawn.mechanism, sensitive)
    assert close(found.by, central(drawn, z, near, values), 5e-3)
    assert found.worst == pytest.approx(limits.worst_of_kinds(sensitive.motions).max(axis=1))


@pytest.mark.parametrize("kind", ["regressor", "structure"])
def test_any_weighted_sum_has_its_slope(drawn, sensitive, kind):
    motions, rng = sensitive.motions, np.random.default_rng(2)
    nodes, rows = np.tile([3, 90], (3, 1)), np.arange(3)[:, None]
    quantity = motions.regressors if kind == "regressor" else motions.dependent
    weights = rng.normal(size=quantity[rows, nodes].shape)
    placed = {"regressors": weights} if kind == "regressor" else {"dependent": weights}
    by = sensitive.at_nodes(drawn.mechanism, nodes, sensitive.weighted(**placed))

    def value(there: Motions) -> np.ndarray:
        each = there.regressors if kind == "regressor" else there.dependent
        return (weights * each[rows, nodes]).sum(axis=(2, 3))

    assert close(by, central(drawn, drawn.pool.z[:3], motions.placed, value))


def test_regressor_is_the_models(drawn, sensitive):
    task, found = drawn.task, sensitive.motions.trajectories
    for w in range(3):
        p, R, v = found.positions[w], found.rotations[w], found.twists[w]
        motion = Motion(found.grid.t, p, R, v, found.accelerations[w])
        xi = drawn.mechanism.structure_matrix(p, R)
        basis = free_twist_basis(xi, marker_selector(R, task.robot.marker, task.axes))
        wanted = basis.transpose(0, 2, 1) @ platform_regressor(motion, task.robot.gravity)
        np.testing.assert_allclose(sensitive.motions.regressors[w], wanted, atol=1e-9)
        free = wanted @ np.concatenate([[1.0], task.shared])
        assert np.abs(free).max() < 1e-8  # W′ χ′ = 0: it is a free motion


def test_conditioning_is_the_models(drawn, sensitive):
    task, found = drawn.task, sensitive.motions.trajectories
    bad = limits.worst_of_kinds(sensitive.motions)[:, 3]
    for w in range(3):
        xi = drawn.mechanism.structure_matrix(found.positions[w], found.rotations[w])
        wanted = conditioning(xi, marker_selector(found.rotations[w], task.robot.marker, task.axes)).max()
        assert task.conditioning ** (1 + bad[w]) == pytest.approx(wanted)


def test_gradient_of_a_and_d(drawn, irma4: Robot):
    """`precision` takes one-sided differences itself: here against central ones of another size."""
    task = DesignTask(irma4, equilibria=3, samples=25, seconds=2.0, native=False, criterion="A")
    z = drawn.pool.z[:3]
    placed = [place(drawn.mechanism, task, one) for one in z]
    at = Sensitive.of(drawn.mechanism, simulate(drawn.mechanism, task, placed))
    found = precision(drawn.mechanism, at)
    w, k, step = 1, 5, np.zeros_like(z)
    step[w, k] = 1e-4
    values = []
    for side in (1, -1):
        both = zip(z + side * step, placed, strict=True)
        there = [place(drawn.mechanism, task, one, near.resting) for one, near in both]
        aside = Sensitive.of(drawn.mechanism, simulate(drawn.mechanism, task, there))
        values.append(precision(drawn.mechanism, aside).value)
    assert (values[0] - values[1]) / 2e-4 == pytest.approx(found.gradient[w, k], rel=0.02)


def test_a_window_that_cannot_rest_is_refused(drawn):
    z = drawn.pool.z[0].copy()
    z[0] += 3.0
    with pytest.raises(InfeasibleError):
        place(drawn.mechanism, drawn.task, z)


@pytest.mark.parametrize(("n", "words"), [(2, "four and five cables"), (3, "four and five cables")])
def test_a_robot_that_cannot_be_designed_is_refused_in_words(cable_ring, n, words):
    with pytest.raises(SetupError, match=words):
        DesignTask(cable_ring(n))


def test_too_few_equations_are_refused(irma4: Robot):
    with pytest.raises(SetupError, match="nine parameters"):
        DesignTask(irma4, equilibria=1, samples=2)


def test_five_cables_have_one_free_coordinate(cable_ring):
    task = DesignTask(cable_ring(5), equilibria=2, seconds=1.0, native=False)
    assert task.axes == (0,)
    assert task.width == 6
    assert Mechanism(task.robot).freedoms == 1


def test_plans_say_both_coordinates_of_a_displacement_with_one_free(cable_ring):
    """The marker's y follows from x: a hand that was told 0 would not bring it there."""
    task = DesignTask(cable_ring(5), equilibria=1, seconds=1.0, native=False)
    mechanism = task.mechanism()
    rest = equilibrium_at(mechanism, task.robot.nominal, np.array([0.15, 0.25, -0.2]))
    there, aside = place(mechanism, task, np.append(rest.lengths, 0.03)).marker_at(task.robot.marker)
    np.testing.assert_allclose(there, rest.marker_position(task.robot.marker), atol=1e-6)
    assert aside[0] == pytest.approx(0.03)
    assert abs(aside[1]) > 1e-4


@pytest.mark.parametrize("criterion", ["A", "D"])
def test_a_robust_criterion_is_the_mean_over_all_bodies(drawn, irma4: Robot, criterion):
    wrong = irma4.nominal.vector * np.array([1, 1, 1.08, 0.95, 1.05, 1.1, 1, 1, 1])
    nominal = DesignTask(irma4, equilibria=3, samples=25, seconds=2.0, native=False, criterion=criterion)
    robust = replace(nominal, bodies=(wrong,))
    placed = [place(drawn.mechanism, nominal, one) for one in drawn.pool.z[:3]]
    at = [Sensitive.of(drawn.mechanism, simulate(drawn.mechanism, task, placed)) for task in (nominal, robust)]
    alone, both = (precision(drawn.mechanism, one) for one in at)
    other = judged(nominal, information(drawn.mechanism, nominal, placed, wrong).sum(axis=0)[np.newaxis])[0]
    assert abs(other / alone.value - 1) > 1e-3, "else the mean shows nothing"
    assert both.value == pytest.approx((alone.value + other) / 2)
