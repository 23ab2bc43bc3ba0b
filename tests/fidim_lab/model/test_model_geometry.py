"""Cables and Ξ against plain geometry and finite differences."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from fidim_lab.errors import InfeasibleError, OurBugError
from fidim_lab.model.geometry import rotation_matrix
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.slots import Effect

RNG = np.random.default_rng(4)


def poses(count):
    turns = Rotation.from_rotvec(RNG.normal(scale=0.2, size=(count, 3))).as_matrix()
    return np.array([1.1, -0.2, -0.3]) + RNG.normal(scale=0.1, size=(count, 3)), turns


def moved(positions, rotations, twists, seconds):
    turn = Rotation.from_rotvec(seconds * twists[:, 3:]).as_matrix()
    return positions + seconds * twists[:, :3], turn @ rotations


def by_tangency(cable, position, rotation):
    """Length, swivel, wrap and direction by finding where the straight part is tangent to the pulley's circle."""
    attachment = position + rotation @ cable.a
    c = attachment - cable.d
    across = c - (c @ cable.z) * cable.z
    u = across / np.linalg.norm(across)
    centre = cable.d + cable.radius * u

    def exit_at(wrap):
        return centre + cable.radius * (-np.cos(wrap) * u + np.sin(wrap) * cable.z)

    wrap = brentq(lambda angle: (attachment - exit_at(angle)) @ (exit_at(angle) - centre), np.pi / 2, 3.3, xtol=1e-15)
    straight = attachment - exit_at(wrap)
    free = np.linalg.norm(straight)
    return cable.radius * wrap + free, np.arctan2(c @ cable.y, c @ cable.x), wrap, straight / free


def test_cables_are_tangent_to_their_pulleys(paper):
    positions, rotations = poses(20)
    found = [paper.lengths, paper.swivel_angles, paper.wrap_angles]
    lengths, swivels, wraps = (method(positions, rotations) for method in found)
    xi = paper.structure_matrix(positions, rotations)
    for k in range(20):
        for i, cable in enumerate(paper.robot.cables):
            length, swivel, wrap, direction = by_tangency(cable, positions[k], rotations[k])
            assert [lengths[k, i], swivels[k, i], wraps[k, i]] == pytest.approx([length, swivel, wrap], abs=1e-12)
            np.testing.assert_allclose(xi[k, i, :3], direction, atol=1e-12)
            np.testing.assert_allclose(xi[k, i, 3:], np.cross(rotations[k] @ cable.a, direction), atol=1e-12)


def test_structure_matrix_is_the_derivative_of_the_lengths(paper):
    positions, rotations = poses(10)
    twists = RNG.normal(size=(10, 6))
    step = 1e-5
    ahead, behind = (paper.lengths(*moved(positions, rotations, twists, s)) for s in (step, -step))
    expected = np.einsum("nij,nj->ni", paper.structure_matrix(positions, rotations), twists)
    np.testing.assert_allclose((ahead - behind) / (2 * step), expected, atol=1e-8)


def test_structure_matrix_rate_is_its_derivative(other):
    positions, rotations = poses(10)
    positions -= [1.0, 0.0, 0.0]
    twists = RNG.normal(size=(10, 6))
    step = 1e-5
    ahead, behind = (other.structure_matrix(*moved(positions, rotations, twists, s)) for s in (step, -step))
    rate = other.structure_matrix_rate(positions, rotations, twists)
    assert rate.shape == (10, other.n, 6)
    np.testing.assert_allclose((ahead - behind) / (2 * step), rate, atol=1e-7)


def test_a_small_pulley_tends_to_the_plain_cable(paper):
    positions, rotations = poses(5)
    plain, small = (
        Mechanism(replace(paper.robot, cables=tuple(replace(c, radius=r) for c in paper.robot.cables)))
        for r in (0.0, 1e-8)
    )
    straight = positions[:, None] + np.einsum("nij,kj->nki", rotations, [c.a for c in paper.robot.cables])
    straight -= [c.d for c in paper.robot.cables]
    np.testing.assert_allclose(plain.lengths(positions, rotations), np.linalg.norm(straight, axis=2), rtol=1e-14)
    np.testing.assert_allclose(small.lengths(positions, rotations), plain.lengths(positions, rotations), atol=5e-8)
    matrices = [m.structure_matrix(positions, rotations) for m in (plain, small)]
    np.testing.assert_allclose(*matrices, atol=1e-7)


def test_a_plain_cable_is_regular_on_its_swivel_axis(paper):
    cable = replace(paper.robot.cables[0], radius=0.0)
    mechanism = Mechanism(replace(paper.robot, cables=(cable,)))
    position = cable.d + 0.7 * cable.z - cable.a
    assert mechanism.lengths(position[None], np.eye(3)[None])[0, 0] == pytest.approx(0.7)
    np.testing.assert_allclose(mechanism.structure_matrix(position[None], np.eye(3)[None])[0, 0, :3], cable.z)


@pytest.mark.parametrize(
    ("offset", "says"),
    [((0.0, 0.0, 0.4), "swivel axis"), ((0.025, 0.0, 0.01), "inside the pulley"), ((0.05, 0.0, 0.0), "inside")],
)
def test_a_singular_pose_names_cable_and_sample(paper, offset, says):
    positions, rotations = poses(3)
    cable = paper.robot.cables[2]
    positions[1] = cable.d + np.column_stack([cable.x, cable.y, cable.z]) @ offset - rotations[1] @ cable.a
    with pytest.raises(InfeasibleError, match=rf"Cable 3 .* sample 2 of 3: .*{says}"):
        paper.lengths(positions, rotations)


def test_a_missing_sample_stays_missing(paper):
    positions, rotations = poses(3)
    positions[1] = np.nan
    assert np.isnan(paper.lengths(positions, rotations)).all(axis=1).tolist() == [False, True, False]


def test_gibbs_rotation_is_a_rotation():
    axis = np.array([1.0, 2.0, -2.0]) / 3
    np.testing.assert_allclose(
        rotation_matrix(np.tan(0.8) * axis), Rotation.from_rotvec(1.6 * axis).as_matrix(), atol=1e-15
    )


class LongerFirstCable(Effect):
    parameters = ("bias",)

    def cable_length(self, number, theta):
        return theta[0] if number == 1 else 0 * theta[0]


class AnchorsMoved(Effect):
    parameters = ("dx", "dz")

    def geometry(self, number, cable, theta):
        shift = cable.d * 0
        shift[0], shift[2] = theta[0], theta[1]
        return replace(cable, d=cable.d + shift)


def test_effects_enter_by_their_slots_and_vanish_at_zero(paper):
    positions, rotations = poses(4)
    effects = (LongerFirstCable(), AnchorsMoved())
    absent, present = Mechanism(paper.robot, effects), Mechanism(paper.robot, effects, [0.003, 0.01, -0.02])
    np.testing.assert_array_equal(absent.lengths(positions, rotations), paper.lengths(positions, rotations))
    expected = paper.lengths(positions - [0.01, 0, -0.02], rotations) + np.array([0.003, 0, 0, 0])
    np.testing.assert_allclose(present.lengths(positions, rotations), expected, atol=1e-14)
    with pytest.raises(OurBugError, match="3 effect parameters expected, 1 given"):
        Mechanism(paper.robot, effects, [0.003])


def test_a_mechanism_can_go_to_another_process(paper):
    positions, rotations = poses(2)
    copy = pickle.loads(pickle.dumps(paper))
    np.testing.assert_array_equal(copy.lengths(positions, rotations), paper.lengths(positions, rotations))
