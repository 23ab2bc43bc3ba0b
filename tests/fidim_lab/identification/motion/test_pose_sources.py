"""Poses from lengths, swivel angles and inclination, against poses known beforehand."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fidim_lab.data.own_sensors import OwnSensors
from fidim_lab.data.records import Campaign, Pose, Robot, Role, Window
from fidim_lab.errors import RefusedError
from fidim_lab.identification.motion.pose_sources import MarkerReadings, PoseSource, predicted, sense_poses
from fidim_lab.identification.motion.sensor_zeros import Compared, calibrated, corrected, stated
from fidim_lab.identification.motion.surface import marker_jacobian
from fidim_lab.identification.motion.virtual_markers import CORNERS, with_poses_from
from fidim_lab.model.mechanism import Mechanism

MIDDLE = np.array([1.2, -0.1, -0.3])


@pytest.fixture(scope="module")
def mechanism(irma4: Robot) -> Mechanism:
    return Mechanism(irma4)


def motion(samples: int = 400):
    """Poses of no particular mechanism: readings need not belong to locked winches."""
    t = np.arange(samples) / 100
    swing = np.column_stack([np.sin((4 + k) * t + k) for k in range(6)]) * [0.05, 0.06, 0.02, 0.1, 0.15, 0.2]
    return t, MIDDLE + swing[:, :3], Rotation.from_rotvec(swing[:, 3:]).as_matrix()


def readings(mechanism: Mechanism, p, R) -> OwnSensors:
    y = predicted(mechanism, p, R, 3)
    return OwnSensors(y[:, :4], y[:, 4:8], y[:, 8:])


def test_swivel_angles_are_those_of_the_geometry(mechanism, irma4):
    """σ = atan2(c·y, c·x) with c = p + R a − d, by hand."""
    _, p, R = motion(5)
    found = readings(mechanism, p, R)
    for i, cable in enumerate(irma4.cables):
        c = p + R @ cable.a - cable.d
        np.testing.assert_allclose(found.swivels[:, i], np.arctan2(c @ cable.y, c @ cable.x), atol=1e-12)
    pitch = Rotation.from_euler("y", 0.3).as_matrix()[None]
    np.testing.assert_allclose(readings(mechanism, p[:1], pitch).inclination[0], [0, 0.3, 0], atol=1e-12)


def test_exact_readings_give_back_the_pose(mechanism):
    _, p, R = motion()
    found = sense_poses(mechanism, readings(mechanism, p, R), stated(2e-5), Pose(MIDDLE, np.eye(3)))
    assert found.known.all()
    np.testing.assert_allclose(found.positions, p, atol=1e-8)
    np.testing.assert_allclose(found.rotations, R, atol=1e-8)


def test_the_stated_uncertainty_is_the_real_one(mechanism):
    t, p, R = motion(600)
    zeros = replace(stated(5e-4), inclination_noise=np.array([5e-3, 5e-3, 1e-2]))
    rng = np.random.default_rng(4)
    noisy = readings(mechanism, p, R)
    noise = rng.normal(size=(len(t), 11)) * zeros.noise(4, 3)
    noisy = OwnSensors(noisy.lengths + noise[:, :4], noisy.swivels + noise[:, 4:8], noisy.inclination + noise[:, 8:])
    found = sense_poses(mechanism, noisy, zeros, Pose(MIDDLE, np.eye(3)))
    turn = Rotation.from_matrix(found.rotations @ np.swapaxes(R, 1, 2)).as_rotvec()
    error = np.column_stack([found.positions - p, turn])
    squared = np.einsum("ni,nij,nj->n", error, np.linalg.inv(found.covariances), error)
    assert squared.mean() == pytest.approx(6.0, rel=0.12)  # 600 samples of χ² with 6 degrees of freedom: ± 0.14
    assert found.chi2_per_dof == pytest.approx(1.0, abs=0.1)


def test_a_missing_reading_leaves_its_sample_without_a_pose_and_markers_help(mechanism):
    _, p, R = motion(50)
    read = readings(mechanism, p, R)
    read.swivels[7, 2] = np.nan
    body = np.array([[0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1]])
    seen = p[:, None] + np.einsum("nij,mj->nmi", R, body)
    seen[9, 1] = np.nan
    alone = sense_poses(mechanism, read, stated(5e-4), Pose(MIDDLE, np.eye(3)))
    both = sense_poses(mechanism, read, stated(5e-4), Pose(MIDDLE, np.eye(3)), MarkerReadings(seen, body, 1e-4))
    assert np.flatnonzero(~alone.known).tolist() == [7]
    traces = [np.trace(found.covariances[k]) for found, k in ((both, 8), (both, 9), (alone, 9))]
    assert traces == sorted(traces)
    assert traces[0] < 0.2 * traces[2]
    np.testing.assert_allclose(both.positions[9], p[9], atol=1e-8)


def test_readings_of_another_robot_are_refused_or_contradict_themselves(mechanism):
    _, p, R = motion(50)
    read = readings(mechanism, p, R)
    swapped = OwnSensors(read.lengths, read.swivels[:, [1, 0, 2, 3]], read.inclination)
    try:
        found = sense_poses(mechanism, swapped, stated(5e-4), Pose(MIDDLE, np.eye(3)))
    except RefusedError:
        return
    assert found.chi2_per_dof > 100


def test_zeros_delays_and_noise_come_back(mechanism):
    t, p, R = motion(600)
    exact = readings(mechanism, p, R)
    zeros, lean = np.array([-0.8, 0.85, -0.86, 0.8]), np.array([-0.02, 0.02, 0.04])
    rng = np.random.default_rng(5)

    def late(values: np.ndarray, delay: float) -> np.ndarray:
        return np.column_stack([np.interp(t - delay, t, column) for column in values.T])

    read = OwnSensors(
        exact.lengths,
        late(exact.swivels, 0.002) + zeros + 1e-3 * rng.normal(size=(600, 4)),
        late(exact.inclination, 0.013) + lean,
    )
    found = calibrated([Compared(t, read, exact)], 2e-5)
    assert found is not None
    np.testing.assert_allclose(found.swivel, zeros, atol=3e-4)
    np.testing.assert_allclose(found.inclination, lean, atol=1e-3)
    assert found.swivel_delay == pytest.approx(0.002, abs=4e-4)
    assert found.inclination_delay == pytest.approx(0.013, abs=5e-4)
    assert found.swivel_noise == pytest.approx(1e-3, rel=0.1)
    mended = corrected(t, read, found)
    inside = np.isfinite(mended.inclination).all(axis=1)
    assert 595 <= inside.sum() < 600
    assert np.abs(mended.inclination[inside][2:] - exact.inclination[inside][2:]).max() < 5e-3
    few = [OwnSensors(s.lengths[:20], s.swivels[:20], s.inclination[:20]) for s in (read, exact)]
    assert calibrated([Compared(t[:20], *few)], 2e-5) is None


def test_four_virtual_markers_carry_the_information_of_the_pose():
    sigma, radius = 2e-3, 0.3
    rotation = Rotation.from_rotvec([0.3, -0.2, 0.5]).as_matrix()[None]
    J = marker_jacobian(rotation, radius * CORNERS)[0]
    information = J.T @ J / sigma**2
    expected = np.diag([4 / sigma**2] * 3 + [8 / 3 * radius**2 / sigma**2] * 3)
    np.testing.assert_allclose(information, expected, atol=1e-6 * expected.max())


def test_a_campaign_without_cameras_gets_poses(mechanism, irma4):
    t, p, R = motion(300)
    read = readings(mechanism, p, R)
    further = {f"s{k + 1}": read.swivels[:, k] for k in range(4)} | {
        f"incl_{axis}": column for axis, column in zip("xyz", read.inclination.T, strict=True)
    }
    window = Window("i01", Role.IDENTIFY, t, np.full((300, 1, 3), np.nan), read.lengths, None, None, further)
    found = with_poses_from(Campaign("dark", irma4, 100.0, (window,)), PoseSource.SWIVEL)
    assert not found.calibrated
    assert found.differences == ()
    virtual = found.campaign.windows[0].markers
    body = found.campaign.robot.markers
    np.testing.assert_allclose(virtual, p[:, None] + np.einsum("nij,mj->nmi", R, body), atol=1e-8)
