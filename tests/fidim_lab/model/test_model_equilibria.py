"""Equilibria: the paper's twelve, and what is refused."""

import numpy as np
import pytest

from fidim_lab.data.records import Motion, Pose
from fidim_lab.errors import InfeasibleError
from fidim_lab.model.kinematics import equilibrium_at, pose_from_lengths
from fidim_lab.model.statics import equilibrium_of_pose, tensions

TABLE_2 = np.array(
    [
        [1.66, 1.32, 1.30, 1.52, 1.11, 1.38, 1.19, 1.16, 1.46, 1.43, 1.35, 1.52],
        [1.86, 1.58, 1.26, 1.26, 1.68, 1.39, 1.15, 1.17, 1.16, 1.37, 1.45, 1.12],
        [1.68, 1.99, 1.57, 1.27, 2.19, 1.36, 1.65, 1.63, 1.24, 1.27, 1.42, 1.17],
        [1.41, 1.76, 1.56, 1.50, 1.72, 1.32, 1.65, 1.59, 1.50, 1.30, 1.28, 1.54],
    ]
).T


@pytest.fixture(scope="module")
def twelve(paper):
    return [pose_from_lengths(paper, paper.robot.nominal, lengths) for lengths in TABLE_2]


def at_rest(pose):
    still = np.zeros((1, 6))
    return Motion(np.zeros(1), pose.position[None], pose.rotation[None], still, still)


def test_table_2_rests_where_the_paper_says(twelve):
    heights = [rest.pose.position[2] for rest in twelve]
    assert (round(min(heights), 2), round(max(heights), 2)) == (-0.75, -0.06)
    assert min(rest.tensions.min() for rest in twelve) == pytest.approx(1.88, abs=0.005)
    for rest, lengths in zip(twelve, TABLE_2, strict=True):
        np.testing.assert_allclose(rest.lengths, lengths, atol=1e-12)
        assert rest.stiffness.shape == (2,)
        assert rest.stiffness.min() > 1


def test_at_rest_the_weight_is_balanced(paper, twelve):
    body = paper.robot.nominal
    for rest in twelve:
        found, residual = tensions(paper, body, at_rest(rest.pose))
        np.testing.assert_allclose(found[0], rest.tensions, atol=1e-9)
        np.testing.assert_allclose(residual, 0, atol=1e-10)


def test_no_nearby_pose_of_the_same_lengths_is_lower(paper, twelve):
    """The energy minimum, by trying: neighbours with shorter or equal cables hold the centre of mass higher."""
    rng = np.random.default_rng(7)
    from scipy.spatial.transform import Rotation

    com = paper.robot.nominal.com
    for rest in twelve[:4]:
        lowest = (rest.pose.position + rest.pose.rotation @ com)[2]
        turns = Rotation.from_rotvec(rng.normal(scale=0.02, size=(4000, 3))).as_matrix() @ rest.pose.rotation
        places = rest.pose.position + rng.normal(scale=0.01, size=(4000, 3))
        allowed = (paper.lengths(places, turns) <= rest.lengths).all(axis=1)
        assert allowed.sum() > 20
        assert (places + turns @ com)[allowed, 2].min() >= lowest


def test_a_start_elsewhere_finds_the_same_rest(paper, twelve):
    far = Pose(position=np.array([1.0, 0.3, -0.5]), rotation=np.eye(3))
    again = pose_from_lengths(paper, paper.robot.nominal, TABLE_2[5], far)
    np.testing.assert_allclose(again.pose.position, twelve[5].pose.position, atol=1e-9)


@pytest.mark.parametrize("place", [(0.6, 0.0, -0.4), (1.8, -0.9, -0.4), (0.9, 0.4, -0.7), (1.2, -0.2, 0.0)])
def test_lengths_for_a_place_lead_back_to_it_from_a_cold_start(paper, place):
    body = paper.robot.nominal
    found = equilibrium_at(paper, body, np.array(place))
    again = pose_from_lengths(paper, body, found.lengths)
    np.testing.assert_allclose(again.pose.position, place, atol=1e-6)


def lengths_for(mechanism):
    """Five equal cables would not all be taut."""
    if mechanism.n < 5:
        return np.full(mechanism.n, 1.3)
    return equilibrium_at(mechanism, mechanism.robot.nominal, np.array([-0.1, -0.1, -0.1])).lengths


def test_rest_of_any_number_of_cables(other):
    body = other.robot.nominal
    lengths = lengths_for(other)
    found = pose_from_lengths(other, body, lengths)
    np.testing.assert_allclose(found.lengths, lengths, atol=1e-10)
    assert found.tensions.min() > 0
    assert found.stiffness.shape == (other.freedoms,)
    assert (found.stiffness == 0).sum() == (1 if other.n == 1 else 0)  # a lone cable lets the platform spin
    np.testing.assert_allclose(tensions(other, body, at_rest(found.pose))[1], 0, atol=1e-9)


def test_a_marker_can_be_sent_to_its_place(paper, twelve):
    body = paper.robot.nominal
    for rest in twelve:
        found = equilibrium_at(paper, body, rest.pose.position)
        np.testing.assert_allclose(found.marker_position(paper.robot.marker), rest.pose.position, atol=1e-7)
        assert found.tensions.min() * 11.0 >= 20.0 - 1e-6
        again = pose_from_lengths(paper, body, found.lengths, found.pose)
        np.testing.assert_allclose(again.pose.position, rest.pose.position, atol=1e-7)


def test_a_marker_can_be_sent_to_its_place_by_any_number_of_cables(other):
    body = other.robot.nominal
    rest = pose_from_lengths(other, body, lengths_for(other))
    wanted = rest.marker_position(other.robot.marker)
    found = equilibrium_at(other, body, wanted, rest.pose)
    np.testing.assert_allclose(found.marker_position(other.robot.marker), wanted, atol=1e-5)


def test_a_place_off_the_curve_of_two_cables_is_refused(make_robot):
    from fidim_lab.model.mechanism import Mechanism

    mechanism = Mechanism(make_robot(2))
    body = mechanism.robot.nominal
    rest = pose_from_lengths(mechanism, body, np.array([1.3, 1.3]))
    aside = rest.marker_position(mechanism.robot.marker) + np.array([0.05, -0.1, 0.0])
    with pytest.raises(InfeasibleError, match="nearest place"):
        equilibrium_at(mechanism, body, aside, rest.pose)


def test_a_place_out_of_reach_is_refused(paper):
    with pytest.raises(InfeasibleError, match="cannot rest"):
        equilibrium_at(paper, paper.robot.nominal, np.array([3.5, 0.0, -0.3]))


def test_a_cable_far_too_long_is_named(paper):
    with pytest.raises(InfeasibleError, match="Cable 2 hangs slack"):
        pose_from_lengths(paper, paper.robot.nominal, np.array([1.3, 2.6, 1.4, 1.4]))


def test_a_pose_that_is_not_at_rest_is_refused(paper, somewhere):
    with pytest.raises(InfeasibleError, match="not at rest"):
        equilibrium_of_pose(paper, paper.robot.nominal, somewhere)
