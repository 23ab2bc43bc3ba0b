"""Free twists and their derivative, dependent poses, conditioning: n = 1…5 cables."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fidim_lab.data.records import Pose
from fidim_lab.errors import InfeasibleError, SetupError
from fidim_lab.model.kinematics import dependent_pose
from fidim_lab.model.motion import best_axes, conditioning, free_twist_basis, marker_selector, motion_from_free
from fidim_lab.model.motion.free_motion import acceleration_from_free, free_twist_basis_rate, marker_selector_rate

RNG = np.random.default_rng(5)


@pytest.fixture(scope="module", params=[1, 2, 3, 4, 5])
def mechanism(request, make_robot):
    from fidim_lab.model.mechanism import Mechanism

    return Mechanism(make_robot(request.param))


def start_of(mechanism):
    turn = Rotation.from_rotvec([0.1, -0.15, 0.2]).as_matrix()
    return Pose(position=np.array([0.12, -0.09, -0.2]), rotation=turn)


def locked_path(mechanism, t):
    """Poses along a smooth path of the best free coordinates at locked lengths."""
    start = start_of(mechanism)
    marker = mechanism.robot.marker
    at = start.position[None], start.rotation[None]
    axes = best_axes(mechanism.structure_matrix(*at), at[1], marker)
    base = np.array([(start.position + start.rotation @ marker)[a] if a < 3 else 0.0 for a in axes])
    size, pace = 0.001 + 0.0001 * np.arange(len(axes)), 3.0 + np.arange(len(axes))
    values = base + size * np.sin(np.outer(t, pace))
    rates = size * pace * np.cos(np.outer(t, pace))
    accelerations = -size * pace**2 * np.sin(np.outer(t, pace))
    lengths = mechanism.lengths(*at)[0]
    return axes, lengths, values, rates, accelerations, dependent_pose(mechanism, lengths, marker, axes, values, start)


def differentiate(mechanism, path, h):
    """Twists by central differences of poses."""
    positions, rotations = path
    turn = Rotation.from_matrix(rotations[2:] @ rotations[:-2].transpose(0, 2, 1)).as_rotvec()
    return np.hstack([positions[2:] - positions[:-2], turn]) / (2 * h)


def test_dependent_poses_keep_lengths_and_follow_the_marker(mechanism):
    axes, lengths, values, *_, (positions, rotations) = locked_path(mechanism, np.arange(0, 1, 0.01))
    np.testing.assert_allclose(mechanism.lengths(positions, rotations), np.tile(lengths, (100, 1)), atol=1e-9)
    markers = positions + rotations @ mechanism.robot.marker
    for column, axis in enumerate(axes):
        if axis < 3:
            np.testing.assert_allclose(markers[:, axis], values[:, column], atol=1e-9)
    np.testing.assert_allclose(rotations @ rotations.transpose(0, 2, 1), np.tile(np.eye(3), (100, 1, 1)), atol=1e-12)


def test_rotation_coordinates_are_twice_the_gibbs_vector_from_the_start(make_robot):
    from fidim_lab.model.mechanism import Mechanism

    mechanism = Mechanism(make_robot(1))
    start = start_of(mechanism)
    place = start.position + start.rotation @ mechanism.robot.marker
    values = np.hstack([place, [0.2, -0.1]])[None]
    lengths = mechanism.lengths(start.position[None], start.rotation[None])[0]
    _, rotations = dependent_pose(mechanism, lengths, mechanism.robot.marker, (0, 1, 2, 3, 4), values, start)
    turned = Rotation.from_matrix(rotations[0] @ start.rotation.T).as_quat()
    np.testing.assert_allclose(2 * turned[:2] / turned[3], [0.2, -0.1], atol=1e-9)


def test_twist_and_acceleration_follow_from_the_marker(mechanism):
    h = 1e-3
    t = np.arange(-0.1, 0.1, h)
    axes, _, _, rates, accelerations, path = locked_path(mechanism, t)
    if max(axes) > 2:
        pytest.skip("rotation rates about fixed axes are not derivatives of coordinates")
    motion = motion_from_free(mechanism, t, path, mechanism.robot.marker, axes, rates, accelerations)
    np.testing.assert_allclose(motion.twists[1:-1], differentiate(mechanism, path, h), atol=2e-5)
    numerical = (motion.twists[2:] - motion.twists[:-2]) / (2 * h)
    np.testing.assert_allclose(motion.accelerations[1:-1], numerical, atol=5e-4)


def test_basis_is_free_selected_and_its_rate_is_its_derivative(mechanism):
    start, marker = start_of(mechanism), mechanism.robot.marker
    at = start.position[None], start.rotation[None]
    axes = best_axes(mechanism.structure_matrix(*at), at[1], marker)

    def matrices(pose):
        return mechanism.structure_matrix(*pose), marker_selector(pose[1], marker, axes)

    xi, selector = matrices(at)
    basis = free_twist_basis(xi, selector)
    free = mechanism.freedoms
    assert basis.shape == (1, 6, free)
    np.testing.assert_allclose(xi @ basis, np.zeros((1, mechanism.n, free)), atol=1e-12)
    np.testing.assert_allclose(selector @ basis, np.eye(free)[None], atol=1e-12)
    twist = (basis @ RNG.normal(size=free)).reshape(1, 6)
    xi_rate = mechanism.structure_matrix_rate(*at, twist)
    selector_rate = marker_selector_rate(at[1], twist, marker, axes)
    rate = free_twist_basis_rate(xi, xi_rate, selector, selector_rate)
    step = 1e-5

    def after(seconds):
        turn = Rotation.from_rotvec(seconds * twist[:, 3:]).as_matrix()
        return at[0] + seconds * twist[:, :3], turn @ at[1]

    numerical = (free_twist_basis(*matrices(after(step))) - free_twist_basis(*matrices(after(-step)))) / (2 * step)
    np.testing.assert_allclose(rate, numerical, atol=1e-5 * np.abs(rate).max())
    wanted = RNG.normal(size=(1, free))
    coordinate_rates = (selector @ twist[..., None])[..., 0]
    expected = (rate @ coordinate_rates[..., None] + basis @ wanted[..., None])[..., 0]  # Eq. 7
    np.testing.assert_allclose(
        acceleration_from_free(xi, xi_rate, selector, selector_rate, twist, wanted), expected, atol=1e-8
    )


def test_conditioning_tells_good_coordinates_from_bad(paper):
    """Orthogonal cable screws: the dependent block is the identity for one choice, singular for the other."""
    xi = np.zeros((1, 4, 6))
    xi[0, range(4), [2, 3, 4, 5]] = 1.0
    rotations = np.eye(3)[None]
    good, bad = (marker_selector(rotations, np.zeros(3), axes) for axes in ((0, 1), (0, 2)))
    assert conditioning(xi, good)[0] == pytest.approx(1.0)
    assert conditioning(xi, bad)[0] > 1e12
    assert best_axes(xi, rotations, np.zeros(3)) == (0, 1)
    with pytest.raises(InfeasibleError, match="not free at sample 1 of 1"):
        free_twist_basis(xi, bad)


@pytest.mark.parametrize("axes", [(0, 6), (1, 1)])
def test_an_axis_that_is_not_one_is_refused(axes):
    with pytest.raises(SetupError, match="named once"):
        marker_selector(np.eye(3)[None], np.zeros(3), axes)


def test_an_unreachable_or_missing_marker_names_its_sample(paper, somewhere):
    lengths = paper.lengths(somewhere.position[None], somewhere.rotation[None])[0]
    values = np.tile(somewhere.position[:2], (6, 1))
    far, missing = values.copy(), values.copy()
    far[3] += [0.0, 5.0]
    missing[4, 0] = np.nan
    for wrong, sample in ((far, 4), (missing, 5)):
        with pytest.raises(InfeasibleError, match=rf"at sample {sample} of 6"):
            dependent_pose(paper, lengths, np.zeros(3), (0, 1), wrong, somewhere)
