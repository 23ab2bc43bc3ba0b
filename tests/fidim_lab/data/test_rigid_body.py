"""The pose and the shape of a marker cluster, against rotations known beforehand and an independent fit (scipy)."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fidim_lab.data.rigid_body import cluster_shape, fit_pose
from fidim_lab.errors import RefusedError

BODY = np.array([[0.2, -0.05, 0.07], [-0.2, -0.08, 0.07], [-0.2, 0.05, 0.09], [0.2, 0.08, 0.05], [-0.01, 0.0, -0.17]])


def moving_cluster(rng: np.random.Generator, samples: int, noise: float = 0.0):
    rotations = Rotation.random(samples, rng=rng).as_matrix()
    positions = rng.normal(size=(samples, 3))
    markers = positions[:, None] + np.einsum("nij,mj->nmi", rotations, BODY)
    return positions, rotations, markers + noise * rng.normal(size=markers.shape)


def test_exact_markers_give_back_the_pose():
    positions, rotations, markers = moving_cluster(np.random.default_rng(1), 50)
    got_positions, got_rotations, rms = fit_pose(markers, BODY)
    assert np.allclose(got_positions, positions, atol=1e-12)
    assert np.allclose(got_rotations, rotations, atol=1e-12)
    assert rms.max() < 1e-12


def test_noisy_markers_give_the_least_squares_rotation_scipy_finds():
    _, _, markers = moving_cluster(np.random.default_rng(2), 20, noise=5e-3)
    _, rotations, _ = fit_pose(markers, BODY)
    for measured, rotation in zip(markers, rotations, strict=True):
        other, _ = Rotation.align_vectors(measured - measured.mean(axis=0), BODY - BODY.mean(axis=0))
        assert np.allclose(rotation, other.as_matrix(), atol=1e-9)


def test_a_flat_cluster_is_never_mirrored():
    flat = BODY * [1.0, 1.0, 0.0]
    rotations = Rotation.random(200, rng=np.random.default_rng(3)).as_matrix()
    markers = np.einsum("nij,mj->nmi", rotations, flat)
    _, got, _ = fit_pose(markers, flat)
    assert np.allclose(got, rotations, atol=1e-9)


def test_missing_markers_are_left_out_and_too_few_give_no_pose():
    positions, rotations, markers = moving_cluster(np.random.default_rng(4), 4)
    markers[0, 4] = np.nan
    markers[1, :2, 1] = np.nan
    markers[2, :3] = np.nan
    markers[3, [2, 3, 4]] = np.nan
    got_positions, got_rotations, rms = fit_pose(markers, BODY)
    assert np.allclose(got_positions[:2], positions[:2], atol=1e-12)
    assert np.allclose(got_rotations[:2], rotations[:2], atol=1e-12)
    assert np.isnan(got_positions[2:]).all()
    assert np.isnan(got_rotations[2:]).all()
    assert np.isnan(rms[2:]).all()


def test_markers_on_one_line_give_no_pose():
    line = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.3, 0.0, 0.0]])
    assert np.isnan(fit_pose(line[None], line)[0]).all()
    with pytest.raises(RefusedError, match="one line"):
        cluster_shape(np.repeat(line[None], 5, axis=0))


def test_the_shape_of_an_unmeasured_cluster_is_found():
    noise = 2e-4
    _, _, markers = moving_cluster(np.random.default_rng(5), 3000, noise=noise)
    markers[::7, 1] = np.nan
    found = cluster_shape(markers)
    _, _, rms = fit_pose(BODY[None], found.markers)
    assert rms[0] < 3.0 * noise / np.sqrt(3000)
    assert found.noise == pytest.approx(noise, rel=0.02)
    assert found.rms < found.noise


def test_samples_with_swapped_markers_do_not_shape_the_cluster():
    _, _, markers = moving_cluster(np.random.default_rng(6), 1000, noise=1e-4)
    markers[100:110, [0, 1]] = markers[100:110, [1, 0]]
    found = cluster_shape(markers)
    assert found.samples_used == 990
    assert found.noise == pytest.approx(1e-4, rel=0.05)


def test_a_cluster_never_whole_is_refused():
    _, _, markers = moving_cluster(np.random.default_rng(7), 10)
    markers[::2, 0], markers[1::2, 1] = np.nan, np.nan
    with pytest.raises(RefusedError, match="0 of 10 samples"):
        cluster_shape(markers)


def test_weights_decide_whom_the_pose_believes():
    positions, rotations, markers = moving_cluster(np.random.default_rng(5), 30)
    markers[:, 1] += 0.05
    weights = np.ones(markers.shape[:2])
    weights[:, 1] = 0.0
    got, turned, rms = fit_pose(markers, BODY, weights)
    assert np.allclose(got, positions, atol=1e-12)
    assert np.allclose(turned, rotations, atol=1e-12)
    assert rms.max() < 1e-12
    weights[:, 1] = 0.3
    rotations = fit_pose(markers, BODY, weights)[1]
    weight = weights[0]
    for measured, rotation in zip(markers, rotations, strict=True):
        share = weight / weight.sum()
        other, _ = Rotation.align_vectors(measured - share @ measured, BODY - share @ BODY, weights=weight)
        assert np.allclose(rotation, other.as_matrix(), atol=1e-9)


def test_markers_without_weight_count_as_not_seen():
    _, _, markers = moving_cluster(np.random.default_rng(6), 4)
    weights = np.ones(markers.shape[:2])
    weights[2, :3] = 0.0
    assert np.isnan(fit_pose(markers, BODY, weights)[0]).all(axis=1).tolist() == [False, False, True, False]
