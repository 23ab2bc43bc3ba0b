"""The rule for hand-free windows, on a simulated recording whose contacts are known."""

import numpy as np
import pytest

from fidim_lab.data.records import Motion
from fidim_lab.errors import RefusedError
from fidim_lab.identification.motion.hand_free import (
    Cut,
    HandFreeRule,
    find_hand_free,
    newton_euler_balance,
    smooth_motion,
)
from fidim_lab.model.mechanism import Mechanism


@pytest.fixture(scope="module")
def mechanism(lab_recording):
    return Mechanism(lab_recording.robot)


@pytest.fixture(scope="module")
def found(lab_recording, mechanism):
    return find_hand_free(mechanism, lab_recording.t, lab_recording.positions, lab_recording.rotations)


def test_every_free_stretch_is_found_and_no_contact_is_inside(found, lab_recording):
    contacts = lab_recording.contacts
    free = [(end, begin) for (_, end), (begin, _) in zip(contacts, [*contacts[1:], (30.0, 30.0)], strict=True)]
    assert len(found.windows) == len(free)
    for window, (begin, end) in zip(found.windows, free, strict=True):
        assert begin <= window.begin < begin + 0.4
        assert end - 0.8 < window.end <= end


def test_each_window_says_why_it_begins_and_ends(found):
    assert all(window.before in (Cut.PUSHED, Cut.UNEXPLAINED) for window in found.windows)
    assert [window.after for window in found.windows[:3]] == [Cut.BRAKED] * 3
    assert found.windows[3].after is Cut.EDGE
    assert "of the kinetic energy per second" in found.windows[0].says


def test_the_soft_yaw_counts_as_a_free_direction(found):
    assert found.balance.free_directions == 3
    assert found.balance.singular_values[3] < 0.1 * found.balance.singular_values[2]


def test_rest_is_not_a_window(found):
    assert all(reason is not None for reason in found.reasons[:190])
    assert found.reasons[50] is Cut.STILL


def test_a_window_stops_where_markers_are_missing(lab_recording, mechanism):
    positions = lab_recording.positions.copy()
    gone = (lab_recording.t > 8.0) & (lab_recording.t < 8.2)
    positions[gone] = np.nan
    rotations = np.where(gone[:, None, None], np.nan, lab_recording.rotations)
    found = find_hand_free(mechanism, lab_recording.t, positions, rotations)
    first = found.windows[0]
    assert 7.0 < first.end < 7.8
    assert first.after is Cut.MISSING


def test_a_recording_too_short_for_the_rule_is_refused(lab_recording, mechanism):
    few = slice(0, 200)
    with pytest.raises(RefusedError, match="too short"):
        find_hand_free(mechanism, lab_recording.t[few], lab_recording.positions[few], lab_recording.rotations[few])
    nothing = np.full((3000, 3), np.nan)
    with pytest.raises(RefusedError, match="three markers"):
        find_hand_free(mechanism, lab_recording.t, nothing, lab_recording.rotations)


def test_smooth_motion_has_the_derivatives_of_a_known_rotation():
    """Rotation about a fixed axis by an angle in time: twist and acceleration are known."""
    t = np.arange(0.0, 6.0, 0.01)
    angle, rate = 0.4 * np.sin(6 * t), 2.4 * np.cos(6 * t)
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    turns = np.eye(3) + np.sin(angle)[:, None, None] * cross + (1 - np.cos(angle))[:, None, None] * (cross @ cross)
    motion = smooth_motion(t, np.outer(np.sin(5 * t), [1.0, 0, 0]), turns, 8.0)
    inside = slice(60, -60)
    assert motion.twists[inside, 3:] == pytest.approx(np.outer(rate, axis)[inside], abs=0.01)
    assert motion.twists[inside, 0] == pytest.approx(5 * np.cos(5 * t[inside]), abs=0.01)
    assert motion.accelerations[inside, 3:] == pytest.approx(np.outer(-36 * angle, axis)[inside], abs=0.1)


def test_the_power_of_a_known_drag_is_found(lab_recording, mechanism):
    """The simulated platform loses 0.01 ω² J/kg a second to its rotational drag; the balance must say so."""
    rows = slice(560, 800)
    whole = smooth_motion(lab_recording.t, lab_recording.positions, lab_recording.rotations, 8.0)
    motion = Motion(
        whole.t[rows], whole.positions[rows], whole.rotations[rows], whole.twists[rows], whole.accelerations[rows]
    )
    rule = HandFreeRule()
    truth = newton_euler_balance(mechanism, motion, rule)
    spin = motion.twists[:, 3:]
    drained = -0.01 * (spin**2).sum(axis=1)
    expected = np.convolve(drained, np.ones(101) / 101, "same") / truth.energy
    assert np.mean(truth.power[50:-50]) == pytest.approx(np.mean(expected[50:-50]), rel=0.1)
