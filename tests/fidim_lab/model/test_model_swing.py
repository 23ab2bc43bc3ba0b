"""Small swings under moving winches, held against the nonlinear model and against the independent plant."""

import numpy as np
import pytest

from fidim_lab.data.records import Pose
from fidim_lab.model.equilibria import equilibrium_at, pose_from_lengths
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.modes import modes
from fidim_lab.model.motion import driven_derivative, driven_motions
from fidim_lab.model.swing import swing_about


@pytest.fixture(scope="module")
def rest(paper: Mechanism):
    return equilibrium_at(paper, paper.robot.nominal, np.array([1.25, -0.15, -0.2]))


@pytest.fixture(scope="module")
def pull() -> np.ndarray:
    """Out and back again within 1 s, half a millimetre: (N, n) m/s²."""
    pattern = np.repeat([1.0, -1.0, -1.0, 1.0], 50)
    return np.outer(pattern, [2e-3, -1e-3, 1.5e-3, 0.0])


def test_linear_theory_foretells_the_swing_after_a_small_stroke(paper: Mechanism, rest, pull):
    swing = swing_about(paper, paper.robot.nominal, rest, 0.04)
    by = np.zeros((*pull.shape, 1))
    end = driven_derivative(paper, paper.robot.nominal, rest.pose, pull, by, damping=swing.damping_matrix())
    found, _ = swing.states(end.pose, end.twist)
    s, h = swing.rates[:, None], 5e-3
    left = (len(pull) - np.arange(len(pull))) * h
    response = (np.exp(s * left) - np.exp(s * (left - h))) / s
    linear = -(swing.gain @ pull.T * response).sum(axis=1) * swing.dragged
    np.testing.assert_allclose(found, linear, atol=0.02 * np.abs(linear).max())


def test_derivative_of_the_end_agrees_with_differences(paper: Mechanism, rest, pull):
    directions = np.array([[0.3, 0.0, -0.2, 0.1], [0.0, 0.5, 0.0, 0.0]])
    by = np.einsum("k,pn->knp", pull[:, 0] / 2e-3, directions)
    swing = swing_about(paper, paper.robot.nominal, rest, 0.02)

    def states(size: np.ndarray):
        end = driven_derivative(
            paper, paper.robot.nominal, rest.pose, pull + by @ size, by, damping=swing.damping_matrix()
        )
        return swing.states(end.pose, end.twist, (end.pose_by, end.twist_by))

    at = np.array([0.1, -0.05])
    slopes = states(at)[1]
    for k, step in enumerate(1e-5 * np.eye(2)):
        difference = (states(at + step)[0] - states(at - step)[0]) / 2e-5
        np.testing.assert_allclose(slopes[:, k], difference, rtol=1e-5, atol=1e-7)


def test_several_bodies_and_steps_of_different_length_at_once(paper: Mechanism, rest, pull):
    bodies = [paper.robot.nominal, paper.robot.nominal]
    alone = driven_motions(paper, paper.robot.nominal, rest.pose, pull[None])
    steps = np.full(len(pull) + 3, 5e-3)
    steps[-3:] = 0.0  # no time passes
    padded = np.vstack([pull, np.ones((3, 4))])
    both = driven_motions(paper, bodies, [rest.pose] * 2, np.array([padded, padded]), steps)
    np.testing.assert_allclose(both.positions[1, -1], alone.positions[0, -1], atol=1e-12)


def test_damping_ratios_come_back_from_a_swing(paper: Mechanism, rest, pull):
    ratios = np.array([0.03, 0.06])
    swing = swing_about(paper, paper.robot.nominal, rest, ratios)
    free = np.vstack([pull, np.zeros((400, 4))])
    found = driven_motions(paper, paper.robot.nominal, rest.pose, free[None], damping=swing.damping_matrix())
    project = swing.shapes.T @ swing.mass
    rates = found.twists[0, 200:] @ project.T
    energy = np.log(np.maximum.accumulate(rates[::-1] ** 2)[::-1])  # envelope of each mode's speed
    t = 5e-3 * np.arange(len(energy))
    slope = np.polyfit(t[:300], energy[:300], 1)[0]
    omega = 2 * np.pi * modes(paper, paper.robot.nominal, rest).frequencies
    np.testing.assert_allclose(-slope / 2 / omega, ratios, rtol=0.25)


def test_a_state_becomes_a_motion_and_comes_back(paper: Mechanism, rest):
    swing = swing_about(paper, paper.robot.nominal, rest, 0.03)
    states = np.array([0.02 + 0.01j, -0.03 + 0.015j])
    pose, twist = swing.motion(states)
    np.testing.assert_allclose(swing.states(pose, twist)[0], states, rtol=1e-3)


def test_a_motion_may_begin_with_a_twist(paper: Mechanism, rest):
    """The second half of a motion from rest is the motion that begins where the first half ended."""
    body, pull = paper.robot.nominal, np.zeros((1, 100, 4))
    swing = swing_about(paper, body, rest)
    pose, twist = swing.motion(np.array([0.05 + 0.02j, 0.02 - 0.04j]))
    whole = driven_motions(paper, body, pose, pull, twist=twist)
    middle = Pose(position=whole.positions[0, 50], rotation=whole.rotations[0, 50])
    half = driven_motions(paper, body, middle, pull[:, :50], twist=whole.twists[0, 50])
    np.testing.assert_allclose(half.positions[0, -1], whole.positions[0, -1], atol=1e-12)
    np.testing.assert_allclose(half.tensions[0, -1], whole.tensions[0, -1], atol=1e-9)
    assert np.abs(whole.twists[0, 0]).max() > 1e-3


def test_tensions_of_a_small_swing_under_moving_winches(paper: Mechanism, rest, pull):
    """q by the linear equation integrated here, tensions by `Pull`, against the nonlinear model's."""
    swing, h = swing_about(paper, paper.robot.nominal, rest), 5e-3
    small, mass = 0.1 * pull, paper.robot.mass
    found = driven_motions(paper, paper.robot.nominal, rest.pose, small[np.newaxis], h).tensions[0]
    q, speed = np.zeros((len(small), 2)), np.zeros(2)
    lengths, winding = np.zeros_like(small), np.zeros(4)
    omega = 2 * np.pi * swing.frequencies
    cosine, sine = np.cos(omega * h), np.sin(omega * h)
    for k in range(len(small) - 1):
        aim = -swing.gain @ small[k] / omega**2
        q[k + 1] = aim + cosine * (q[k] - aim) + sine * speed / omega
        speed = cosine * speed - omega * sine * (q[k] - aim)
        lengths[k + 1] = lengths[k] + h * winding + h**2 / 2 * small[k]
        winding = winding + h * small[k]
    linear = q @ swing.pull.by_swing.T + lengths @ swing.pull.by_lengths.T + small @ swing.pull.by_acceleration.T
    seen = mass * (found - rest.tensions)
    np.testing.assert_allclose(seen, mass * linear, atol=0.02 * np.abs(seen).max())


def test_lengths_that_change_slowly_pull_as_other_rests_do(paper: Mechanism, rest):
    swing, moved = swing_about(paper, paper.robot.nominal, rest), np.array([1e-4, -5e-5, 0.0, 8e-5])
    there = pose_from_lengths(paper, paper.robot.nominal, rest.lengths + moved, rest.pose)
    np.testing.assert_allclose(there.tensions - rest.tensions, swing.pull.by_lengths @ moved, rtol=0.02, atol=1e-5)
