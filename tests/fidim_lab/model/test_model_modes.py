"""Modes against simulated motion, the paper's range, and pendulums with closed forms."""

import numpy as np
import pytest

from fidim_lab.data.records import Body, Cable, Robot
from fidim_lab.errors import SetupError
from fidim_lab.model.kinematics import pose_from_lengths
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.modes import mass_matrix, modes, scaled_singular_values
from fidim_lab.model.motion import free_twist_basis, marker_selector, simulate_free_motion

ENDS = {1: [1.66, 1.86, 1.68, 1.41], 2: [1.32, 1.58, 1.99, 1.76], 12: [1.52, 1.12, 1.17, 1.54]}  # Table 2
IDENTIFIED = Body(  # Eq. 46
    com=np.array([0.002, -0.0025, 0.1984]), inertia=np.array([0.0569, 0.0627, 0.0314, 2e-4, -2e-4, 1.6e-4])
)


@pytest.mark.parametrize("k", ENDS)
def test_frequencies_are_those_of_the_simulated_motion(paper, k):
    body = paper.robot.nominal
    rest = pose_from_lengths(paper, body, np.array(ENDS[k]))
    found = modes(paper, body, rest)
    times = np.arange(0, 20, 0.01)
    for frequency, shape in zip(found.frequencies, found.shapes.T, strict=True):
        motion = simulate_free_motion(paper, body, rest.pose, 1e-3 * shape, times).motion
        momentum = mass_matrix(body, rest.pose.rotation) @ shape
        speed = motion.twists @ momentum
        crossings = np.flatnonzero(np.diff(np.sign(speed)))
        exact = times[crossings] - speed[crossings] * 0.01 / (speed[crossings + 1] - speed[crossings])
        measured = (len(exact) - 1) / 2 / (exact[-1] - exact[0])
        assert measured == pytest.approx(frequency, rel=1e-5)


@pytest.mark.parametrize(("which", "ends"), [("identified", [1.1, 3.4]), ("nominal", [1.1, 3.7])])
def test_table_2_oscillates_in_the_papers_range(paper, which, ends):
    """With the body the paper identified; its CAD values make the stiffest equilibrium faster."""
    body = IDENTIFIED if which == "identified" else paper.robot.nominal
    found = [modes(paper, body, pose_from_lengths(paper, body, np.array(k))).frequencies for k in ENDS.values()]
    assert np.round([np.min(found), np.max(found)], 1).tolist() == ends


def test_modes_do_not_depend_on_the_basis(paper):
    body = paper.robot.nominal
    rest = pose_from_lengths(paper, body, np.array(ENDS[12]))
    xi = paper.structure_matrix(rest.pose.position[None], rest.pose.rotation[None])
    basis = free_twist_basis(xi, marker_selector(rest.pose.rotation[None], paper.robot.marker, (0, 1)))[0]
    plain, chosen = modes(paper, body, rest), modes(paper, body, rest, basis)
    np.testing.assert_allclose(plain.frequencies, chosen.frequencies, rtol=1e-9)
    np.testing.assert_allclose(np.abs(plain.shapes), np.abs(chosen.shapes), atol=1e-9)
    np.testing.assert_allclose(chosen.mass, basis.T @ mass_matrix(body, rest.pose.rotation) @ basis)


def eyelet(d, a):
    x, y, z = np.eye(3)[[0, 2, 1]] * [[1], [1], [-1]]
    return Cable(d=np.array(d), a=np.array(a), radius=0.0, x=x, y=y, z=z)


def bifilar(half=0.3, length=1.7, drop=0.25):
    """A bar on two parallel cables, its centre of mass below the middle of the attachments."""
    cables = tuple(eyelet([side * half, 0.0, length], [side * half, 0.0, 0.0]) for side in (-1.0, 1.0))
    com = np.array([0.0, 0.0, -drop])
    about_com = np.array([0.04, 0.05, 0.06])
    inertia = np.concatenate([about_com + np.array([drop**2, drop**2, 0.0]), np.zeros(3)])
    robot = Robot(cables=cables, mass=2.0, nominal=Body(com=com, inertia=inertia), marker=np.zeros(3))
    return Mechanism(robot), about_com


def test_a_bifilar_pendulum_has_its_closed_form_frequencies():
    half, length, drop, gravity = 0.3, 1.7, 0.25, 9.81
    mechanism, about_com = bifilar(half, length, drop)
    rest = pose_from_lengths(mechanism, mechanism.robot.nominal, np.full(2, length))
    np.testing.assert_allclose(rest.tensions, gravity / 2)
    twisting = np.sqrt(gravity * half**2 / (about_com[2] * length))
    swaying = np.sqrt(gravity / length)
    # across the plane of the cables it is a double pendulum, the first link without mass
    mass = np.array([[length**2, length * drop], [length * drop, drop**2 + about_com[0]]])
    double = np.sqrt(np.linalg.eigvals(np.linalg.solve(mass, gravity * np.diag([length, drop]))))
    expected = np.sort([twisting, swaying, *double]) / (2 * np.pi)
    np.testing.assert_allclose(modes(mechanism, mechanism.robot.nominal, rest).frequencies, expected, rtol=1e-9)


def test_a_bifilar_pendulum_twists_with_its_closed_form_period():
    """Twisting by θ raises the bar: φ̇ is slow enough at 0.02 rad for the small-angle period."""
    half, length = 0.3, 1.7
    mechanism, about_com = bifilar(half, length)
    rest = pose_from_lengths(mechanism, mechanism.robot.nominal, np.full(2, length))
    period = 2 * np.pi * np.sqrt(about_com[2] * length / (9.81 * half**2))
    motion = simulate_free_motion(
        mechanism,
        mechanism.robot.nominal,
        rest.pose,
        np.array([0, 0, 0, 0, 0, 0.02]),
        np.array([0, period / 4, period]),
    ).motion
    assert motion.twists[1, 5] == pytest.approx(0, abs=1e-5)
    assert motion.twists[2, 5] == pytest.approx(0.02, rel=1e-6)


def test_a_body_that_cannot_exist_has_no_modes(paper):
    rest = pose_from_lengths(paper, paper.robot.nominal, np.array(ENDS[12]))
    impossible = Body(com=np.array([0, 0, 0.19]), inertia=np.array([-0.2, -0.2, -0.1, 0, 0, 0]))
    with pytest.raises(SetupError, match="not positive definite"):
        modes(paper, impossible, rest)


def test_singular_values_show_the_soft_mode():
    """Four cables that almost meet in one point of the platform: yaw is held by a lever of 3 mm."""
    angles = np.arange(4) * np.pi / 2

    def smallest(spread):
        cables = tuple(
            eyelet([np.cos(a), np.sin(a), 1.0], [spread * np.cos(a + lag), spread * np.sin(a + lag), 0.0])
            for a, lag in zip(angles, [1.2, -1.2, 1.2, -1.2], strict=True)
        )
        body = Body(com=np.zeros(3), inertia=np.array([0.1, 0.1, 0.1, 0, 0, 0]))
        mechanism = Mechanism(Robot(cables=cables, mass=1.0, nominal=body, marker=np.zeros(3)))
        return scaled_singular_values(mechanism.structure_matrix(np.zeros((1, 3)), np.eye(3)[None]))[0]

    firm, soft = smallest(0.25), smallest(0.003)
    assert firm[3] > 0.3 * firm[2]
    assert soft[3] < 0.1 * soft[2]
    # unit vector of alternating signs over the cables: each row's yaw lever is ± spread · sin 1.2 / √2
    assert soft[3] == pytest.approx(2 * 0.003 * np.sin(1.2) / np.sqrt(2) / 0.2, rel=0.01)
