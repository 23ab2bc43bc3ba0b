"""Registration from locked motors, on a simulated recording whose hidden transforms are known."""

import numpy as np
import pytest

from fidim_lab.data.importers.registry import read_recording
from fidim_lab.data.rigid_body import cluster_shape, fit_pose
from fidim_lab.errors import RefusedError
from fidim_lab.identification.calibration.arrangement import choose, judge
from fidim_lab.identification.calibration.registration import _LengthProblem, register
from fidim_lab.model.mechanism import Mechanism


@pytest.fixture(scope="module")
def tracked(lab_recording):
    """Recording, mechanism, cluster shape, cluster poses."""
    recording = read_recording("irma4u", [lab_recording.folder])
    cluster = cluster_shape(recording.markers.positions)
    positions, rotations, _ = fit_pose(recording.markers.positions, cluster.markers)
    return recording, Mechanism(recording.robot), cluster, positions, rotations


@pytest.fixture(scope="module")
def arrangements(tracked):
    recording, mechanism, _, positions, rotations = tracked
    return [
        judge(mechanism, registration, recording.markers.t, positions, rotations, recording.log)
        for registration in register(mechanism, positions, rotations)
    ]


def test_the_lengths_alone_do_not_tell_which_way_round_the_robot_stands(arrangements):
    """What makes `judge` necessary: the right arrangement is not the one with the smallest misfit."""
    assert len(arrangements) >= 2
    right = choose(arrangements)
    assert min(evidence.rigid.rms for evidence in arrangements) < right.rigid.rms


def test_swivel_angles_and_stretch_agree_on_the_right_arrangement(arrangements, lab_recording):
    right = choose(arrangements)
    others = [evidence for evidence in arrangements if evidence is not right]
    assert right.clock.correlation > 0.99
    assert max(evidence.clock.correlation for evidence in others) < 0.8
    assert right.gain > 0.9
    assert max(evidence.gain for evidence in others) < 0.3
    assert right.stretched.compliance == pytest.approx(lab_recording.compliance, rel=0.05)
    assert right.stretched.rms < 5e-5


def test_the_hidden_transforms_are_found(tracked, arrangements, lab_recording):
    _, _, cluster, positions, rotations = tracked
    placed = choose(arrangements).stretched
    assert placed.body.points(cluster.markers) == pytest.approx(lab_recording.body_markers, abs=5e-4)
    assert np.degrees(placed.tilt) == pytest.approx(np.degrees(lab_recording.tilt), abs=0.15)
    found_positions, found_rotations = placed.poses(positions, rotations)
    assert found_positions == pytest.approx(lab_recording.positions, abs=5e-3)
    turns = np.einsum("nji,njk->nik", found_rotations, lab_recording.rotations)
    assert np.degrees(np.arccos(np.clip((np.trace(turns, axis1=1, axis2=2) - 1) / 2, -1, 1)).max()) < 0.5


def test_the_clocks_are_aligned_by_the_way(arrangements, lab_recording):
    right = choose(arrangements)
    assert right.clock.offset == pytest.approx(lab_recording.clock_offset, abs=5e-4)
    assert right.inclinometer.offset == pytest.approx(lab_recording.clock_offset, abs=5e-4)


def test_derivatives_agree_with_differences(tracked):
    _, mechanism, _, positions, rotations = tracked
    tensions = np.random.default_rng(2).normal(size=(30, 4))
    for stretch in (None, tensions - tensions.mean(axis=0)):
        problem = _LengthProblem(mechanism, positions[500:530], rotations[500:530], stretch)
        at = np.array([0.1, 0.2, 0.0, 0.3, -0.2, 1.5, 0.01, 0.02, 0.2, -0.1, 0.2, 0.4])
        differences = [
            (problem.residual(at + 1e-6 * unit) - problem.residual(at - 1e-6 * unit)) / 2e-6 for unit in np.eye(12)
        ]
        assert problem.jacobian(at) == pytest.approx(np.array(differences).T, abs=1e-8)


def test_a_recording_of_running_motors_is_refused(tracked):
    _, mechanism, _, positions, rotations = tracked
    seconds = 0.01 * np.arange(len(positions))
    moved = positions + np.outer(np.sin(0.5 * seconds), [0.1, 0.05, 0.2])
    with pytest.raises(RefusedError, match="No placing of the markers"):
        register(mechanism, moved[::5], rotations[::5])


def test_a_log_of_another_day_is_refused(arrangements):
    """With the right arrangement gone, none agrees with the swivel angles."""
    wrong = [evidence for evidence in arrangements if evidence is not choose(arrangements)]
    with pytest.raises(RefusedError, match="No arrangement agrees"):
        choose(wrong)
    with pytest.raises(RefusedError, match="Two arrangements agree"):
        choose([choose(arrangements)] * 2)
