"""The paper's equations from takes: on a simulated take the truth, on the paper's own takes its printed digits."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat
from scipy.spatial.transform import Rotation

from benchmarks.reproduce import paper
from benchmarks.reproduce.processed import Processed, motion_of, read_bodies, read_processed
from benchmarks.reproduce.takes import (
    by_free_coordinates,
    by_full_pose,
    cross_validated,
    difference_percent,
)
from fidim_lab.data.importers.grab import FITTED, VALIDATED, read_grab
from fidim_lab.data.records import Body, Robot
from fidim_lab.model.equilibria import equilibrium_at
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion import simulate_free_motion


def test_rates_of_angles_become_spins() -> None:
    """By finite differences of scipy's rotation matrices, intrinsic x-y-z."""
    t = np.linspace(0.0, 1.0, 2001)
    angles = np.column_stack([0.3 * np.sin(3 * t), 0.2 * np.cos(2 * t), 0.5 * t**2])
    rates = np.column_stack([0.9 * np.cos(3 * t), -0.4 * np.sin(2 * t), t])
    second = np.column_stack([-2.7 * np.sin(3 * t), -0.8 * np.cos(2 * t), np.ones_like(t)])
    none = np.zeros((len(t), 3))
    motion = motion_of(np.hstack([none, angles]), np.hstack([none, rates]), np.hstack([none, second]))
    turns = Rotation.from_euler("XYZ", angles)
    np.testing.assert_allclose(motion.rotations, turns.as_matrix(), atol=1e-12)
    between = (turns[1:] * turns[:-1].inv()).as_rotvec() / (t[1] - t[0])
    middle = (motion.twists[1:, 3:] + motion.twists[:-1, 3:]) / 2
    np.testing.assert_allclose(between, middle, atol=1e-5)
    grown = np.gradient(motion.twists[:, 3:], t, axis=0)
    np.testing.assert_allclose(grown[1:-1], motion.accelerations[1:-1, 3:], atol=1e-5)


@pytest.fixture(scope="module")
def exact(irma4: Robot) -> tuple[Robot, list[Processed], Body]:
    """Four takes of a known body without any noise."""
    robot, body, takes = replace(irma4, marker=np.zeros(3)), paper.FULL.body, list[Processed]()
    mechanism = Mechanism(robot)
    for k, place in enumerate([(1.25, -0.15, -0.2), (1.1, 0.1, -0.35), (1.35, -0.35, -0.3), (1.4, 0.05, -0.25)]):
        rest = equilibrium_at(mechanism, body, np.array(place))
        xi = mechanism.structure_matrix(rest.pose.position[None], rest.pose.rotation[None])[0]
        free = np.linalg.svd(xi)[2][4:].T
        motion = simulate_free_motion(mechanism, body, rest.pose, free @ [0.2, -0.25], np.arange(301) / 100).motion
        takes.append(Processed(k + 1, 4, motion, motion.twists[:, :3], motion.accelerations[:, :3]))
    return robot, takes, body


def test_without_noise_both_forms_give_the_truth(exact: tuple[Robot, list[Processed], Body]) -> None:
    robot, takes, body = exact
    for found in (by_full_pose(robot, takes), by_free_coordinates(robot, takes), by_full_pose(robot, takes, 100)):
        np.testing.assert_allclose(found.solution.values, body.vector, atol=1e-7)
    assert all(one.sigma < 1e-6 for one in cross_validated(robot, takes, body))


def test_another_body_shows_in_fig_3(exact: tuple[Robot, list[Processed], Body]) -> None:
    robot, takes, body = exact
    other = Body(body.com + np.array([0.0, 0.0, 0.01]), body.inertia)
    for one in cross_validated(robot, takes, other):
        assert one.sigma > 1e-3
        assert one.mean_square == pytest.approx(one.sigma**2 / 2)  # two equations a sample


@pytest.mark.shared
def test_eq_47_comes_out_to_the_last_digit(shared: Path) -> None:
    folder = shared / "recordings" / "grab"
    robot = read_grab(folder, lambda number: number == 8)[0].robot
    takes = [take for number in sorted(FITTED) if (take := read_processed(folder, number)) is not None]
    full, free = by_full_pose(robot, takes), by_free_coordinates(robot, takes)
    lab = loadmat(folder / "identification" / "res_opt.mat", squeeze_me=True)
    np.testing.assert_allclose(full.solution.values, lab["X_opt"][1:], rtol=1e-9)
    np.testing.assert_allclose(full.printed_percent, np.abs(lab["sigma_perc_opt"]), rtol=1e-6)
    assert pytest.approx(float(lab["val_opt"]), rel=1e-9) == full.solution.C
    assert len(free.takes) == 12
    assert np.abs(free.solution.values / paper.FREE.values - 1)[:6].max() < 0.03
    assert difference_percent(paper.FREE.body, paper.FULL.body)[2] == pytest.approx(0.8, abs=0.05)
    held_out = [take for number in sorted(VALIDATED) if (take := read_processed(folder, number)) is not None]
    checked = cross_validated(robot, held_out, paper.FREE.body)
    assert sum(one.sigma > paper.FREE.sigma_W for one in checked) == 3
    assert sum(one.mean_square > paper.FREE.sigma_W for one in checked) == paper.SIGMA_PERP_ABOVE
    assert set(read_bodies(folder)) == {4, 3, 2}
