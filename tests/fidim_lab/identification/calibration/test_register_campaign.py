"""Frame, markers and encoder zeros: what is put in comes out within the ± that is stated."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fidim_lab.errors import RefusedError
from fidim_lab.identification.calibration.register_campaign import register_campaigns, registered_robot
from fidim_lab.model.mechanism import Mechanism

NOISE = 1e-4


def moved(campaign, turn: np.ndarray, shift: np.ndarray):
    windows = tuple(replace(w, markers=w.markers @ turn.T + shift) for w in campaign.windows)
    return replace(campaign, windows=windows)


def covered(campaign):
    """Its main marker is never seen."""
    windows = tuple(replace(w, markers=w.markers.copy()) for w in campaign.windows)
    for window in windows:
        window.markers[:, 0] = np.nan
    return replace(campaign, windows=windows)


@pytest.mark.parametrize(("cluster", "seen"), [(True, covered), (False, lambda c: c), (True, lambda c: c)])
@pytest.mark.sampled(1)
def test_a_turned_and_shifted_frame_comes_back(recorded, cluster: bool, seen):
    turn, shift = Rotation.from_rotvec([0.02, -0.03, 1.0]).as_matrix(), np.array([0.5, -0.2, 0.1])
    campaign = seen(recorded(noise=NOISE, cluster=cluster))
    found = register_campaigns([moved(campaign, turn, shift)])
    assert found.free.says == "frame"
    best = found.best
    off = Rotation.from_matrix(best.placement.turn @ turn).as_rotvec()
    assert (np.abs(off) < 4 * best.sd_turn).all()
    assert (np.abs(best.placement.turn @ shift + best.placement.shift) < 4 * best.sd_shift + 1e-4).all()
    assert best.chi2_per_dof < 1.5
    robot = registered_robot(campaign.robot, found)
    for before, after in zip(campaign.robot.cables, robot.cables, strict=True):
        np.testing.assert_allclose(turn @ before.d + shift, after.d, atol=2e-3)
        np.testing.assert_allclose(np.cross(after.x, after.y), after.z, atol=1e-12)
    np.testing.assert_allclose(robot.gravity, turn @ campaign.robot.gravity, atol=0.02)


def test_lengths_that_the_poses_gave_register_nothing(recorded):
    """They agree with the wrong frame that they were computed in."""
    campaign = moved(recorded(noise=NOISE, cluster=True), np.eye(3), np.array([0.05, 0.02, 0.0]))
    by_poses = tuple(replace(w, lengths_by_poses=True) for w in campaign.windows)
    with pytest.raises(RefusedError, match="agree with any capture frame"):
        register_campaigns([replace(campaign, windows=by_poses)])
    mixed = (*by_poses[:1], *campaign.windows[1:])
    best = register_campaigns([replace(campaign, windows=mixed)]).best
    assert (np.abs(best.placement.shift - np.array([-0.05, -0.02, 0.0])) < 4 * best.sd_shift + 1e-4).all()


def test_a_marker_elsewhere_comes_back(recorded):
    campaign = recorded(noise=NOISE)
    by = np.array([0.03, -0.02, 0.04])
    wrong = replace(campaign, robot=replace(campaign.robot, marker=campaign.robot.marker + by))
    found = register_campaigns([wrong])
    assert found.free.says == "markers"
    assert (np.abs(found.best.placement.body[0] - campaign.robot.marker) < 4 * found.best.sd_body[0]).all()


def test_of_markers_one_of_which_is_never_seen_the_others_come_back(recorded):
    campaign = recorded(noise=NOISE, cluster=True)
    by = np.array([0.03, -0.02, 0.04])
    wrong = covered(
        replace(campaign, robot=replace(campaign.robot, extra_markers=tuple(campaign.robot.markers[1:] + by)))
    )
    found = register_campaigns([wrong])
    assert found.sample.numbers == (1, 2, 3)
    robot = registered_robot(wrong.robot, found)
    np.testing.assert_allclose(robot.markers, campaign.robot.markers, atol=2e-3)


def test_zeros_of_encoders_come_back(recorded):
    campaign = recorded(noise=NOISE, cluster=True)
    zeros = np.array([0.01, -0.02, 0.005, 0.015])
    windows = tuple(replace(w, lengths=w.lengths + zeros) for w in campaign.windows)
    found = register_campaigns([replace(campaign, windows=windows)])
    assert found.free.says == "zeros"
    assert (np.abs(found.best.placement.zeros - zeros) < 4 * found.best.sd_zeros).all()


def test_the_anchor_that_was_moved_is_the_one_that_disagrees(recorded):
    campaign = recorded(noise=NOISE, cluster=True)
    cables = list(campaign.robot.cables)
    cables[1] = replace(cables[1], d=cables[1].d + np.array([0.03, -0.02, 0.01]))
    found = register_campaigns([replace(campaign, robot=replace(campaign.robot, cables=tuple(cables)))])
    best = min(found.suspects, key=lambda one: one.chi2_per_dof)
    assert best.cable == 2
    assert Mechanism(campaign.robot).n == len(found.suspects)
