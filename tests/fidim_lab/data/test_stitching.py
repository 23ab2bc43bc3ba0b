"""Labels that are swapped, lost or on the wrong place are mended by the rigid distances; what is right stays."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fidim_lab.data.stitching import stitch

BODY = np.array([[0.0, 0, 0], [0.2, 0, 0], [0, 0.35, 0], [0.1, 0.1, 0.3], [-0.15, 0.05, 0.1]])


@pytest.fixture
def moving() -> np.ndarray:
    t = np.arange(300) / 100.0
    turn = Rotation.from_rotvec(np.column_stack([0.3 * np.sin(t), 0.2 * np.cos(2 * t), t])).as_matrix()
    place = np.column_stack([0.2 * np.sin(3 * t), 0.1 * t, 1.0 + 0 * t])
    noise = 5e-5 * np.random.default_rng(5).normal(size=(300, 5, 3))
    return place[:, None] + np.einsum("nij,mj->nmi", turn, BODY) + noise


def test_what_is_right_is_left_alone(moving: np.ndarray):
    found = stitch(moving, moving, BODY)
    assert (found.markers == moving).all()
    assert (found.relabelled, found.found) == (0, 0)


def test_swapped_labels_are_swapped_back(moving: np.ndarray):
    spoilt = moving.copy()
    spoilt[0:5] = moving[0:5][:, [1, 0, 2, 3, 4]]  # from the first sample on: there is no pose before it
    spoilt[100:180] = moving[100:180][:, [0, 3, 1, 2, 4]]
    found = stitch(spoilt, spoilt, BODY)
    assert found.markers == pytest.approx(moving)
    assert found.relabelled == 85


def test_a_marker_without_its_label_is_found_among_the_loose_places(moving: np.ndarray):
    spoilt, loose = moving.copy(), np.full((300, 2, 3), np.nan)
    loose[40:90, 1] = moving[40:90, 2]
    loose[:, 0] = [2.0, 2.0, 0.0]  # a reflection in the hall
    spoilt[40:90, 2] = np.nan
    spoilt[200:210] = np.nan  # all lost for a while
    found = stitch(spoilt, np.concatenate([spoilt, loose], axis=1), BODY)
    assert found.found == 50
    assert found.markers[40:90] == pytest.approx(moving[40:90])
    assert np.isnan(found.markers[200:210]).all()


def test_a_marker_on_a_reflection_is_taken_off_it(moving: np.ndarray):
    spoilt = moving.copy()
    spoilt[50:60, 4] = [2.0, 2.0, 0.0]
    found = stitch(spoilt, spoilt, BODY)
    assert np.isnan(found.markers[50:60, 4]).all()
    assert found.markers[50:60, :4] == pytest.approx(moving[50:60, :4])


def test_a_shape_that_tells_nothing_apart_is_left_in_doubt():
    square = np.array([[0.1, 0.1, 0], [-0.1, 0.1, 0], [-0.1, -0.1, 0], [0.1, -0.1, 0]])
    markers = np.tile(square + 1.0, (60, 1, 1))
    markers[0] = markers[0][[1, 0, 2, 3]]
    assert (stitch(markers, markers, square).markers[0] == markers[0]).all()


def test_a_marker_that_is_off_gives_no_other_its_name():
    """Of a shape that is nearly its own turned image, one displaced marker makes exchanged names fit, too."""
    rng, t = np.random.default_rng(3), np.arange(400) / 100.0
    shape = np.array([[0.1, 0.1, 0], [-0.1, 0.1, 0.01], [-0.1, -0.11, 0], [0.1, -0.1, 0.02]])
    turn = Rotation.from_rotvec(np.column_stack([0.3 * np.sin(3 * t), 0.2 * np.cos(5 * t), 0.2 * t])).as_matrix()
    markers = np.einsum("nij,mj->nmi", turn, shape) + np.column_stack([0.1 * np.sin(6 * t), t, 1.0 + 0 * t])[:, None]
    spoilt = markers.copy()
    off = np.arange(10, 400, 10)
    away = rng.normal(size=(len(off), 3))
    spoilt[off, 1] += rng.uniform(0.012, 0.028, (len(off), 1)) * away / np.linalg.norm(away, axis=1)[:, None]
    found = stitch(spoilt, spoilt, shape).markers
    assert found[:, [0, 2, 3]] == pytest.approx(markers[:, [0, 2, 3]])
    assert np.isfinite(found[:, 1]).all(axis=1).sum() <= 400 - len(off) // 2
