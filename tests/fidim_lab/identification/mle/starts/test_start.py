"""First guesses where the platform hangs turned far away from its rest at these lengths."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fidim_lab.data.records import Role, Window
from fidim_lab.data.robot_file import PAPERS_ROBOT, read_robot
from fidim_lab.effects.cables.cable_elasticity import CableStiffness, WinchHoldCompliance
from fidim_lab.identification.mle import fit as fit_module
from fidim_lab.identification.mle.starts.start import first_guess
from fidim_lab.identification.mle.starts.start_poses import rest_near
from fidim_lab.identification.mle.trajectories.recordings import prepare
from fidim_lab.identification.motion.rigid import register
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.starts import yielding_encoders

LENGTHS = (1.64678, 1.21362, 1.44352, 1.7968)
# the first eighth of a second of a window of the independent simulator, m; from its rest the search finds another pose,
# 32 mm off
PATH = (
    (1.55736, -0.33766, -0.44612),
    (1.55727, -0.33755, -0.44677),
    (1.55661, -0.33695, -0.44785),
    (1.55626, -0.33651, -0.45029),
    (1.55531, -0.33574, -0.45305),
    (1.55444, -0.33491, -0.4571),
    (1.55326, -0.33357, -0.46165),
    (1.55178, -0.33217, -0.46662),
    (1.55051, -0.33042, -0.47251),
    (1.54878, -0.32846, -0.47865),
    (1.54684, -0.32697, -0.485),
    (1.54511, -0.32443, -0.49117),
)


def test_the_pose_that_fits_is_found_though_the_way_from_rest_leads_to_another():
    robot = read_robot(PAPERS_ROBOT)
    # held for a while after, so that the window is long enough to be one
    markers = np.concatenate([np.array(PATH), np.full((40, 3), np.nan), np.array(PATH[-1:])])[:, np.newaxis]
    t = np.arange(len(markers)) / 100
    window = Window("i02", Role.IDENTIFY, t, markers, np.tile(LENGTHS, (len(t), 1)), None, np.array(PATH[0]))
    guess = first_guess(Mechanism(robot), robot.nominal, prepare(window, robot))
    assert guess.misfit < 1e-3


def test_an_encoder_that_turns_with_the_tension_is_read_at_the_start(four, record):
    window = record(four, 1)[0]
    swinging = window.lengths + 1e-3 * np.cos(3 * window.t)[:, None]
    recording = prepare(replace(window, lengths=swinging), four)
    read = recording.read((2,))
    assert read[2] == pytest.approx(swinging[0, 2], abs=1e-4)
    np.testing.assert_allclose(np.delete(read, 2), np.delete(recording.lengths, 2))
    assert abs(recording.lengths[2] - swinging[0, 2]) > 5e-4
    assert yielding_encoders(Mechanism(four, (WinchHoldCompliance(cable=3),))) == (2,)
    assert yielding_encoders(Mechanism(four, (CableStiffness(),))) == ()


def test_without_encoders_one_marker_starts_near_a_rest_below_it(four, record):
    seen = replace(four, extra_markers=(np.array([0.15, 0.1, 0.1]), np.array([-0.1, 0.14, 0.12])))
    mechanism = Mechanism(four)
    for window in record(seen, 4, markers=3, noise=0.0):
        truth = register(window.markers[:1], seen.markers, np.ones((1, 3)))[1][0]
        unread = replace(window, lengths=None, markers=window.markers[:, :1])
        guess = first_guess(mechanism, four.nominal, prepare(unread, four))
        assert guess.misfit < 1e-6
        off = Rotation.from_matrix(guess.rotation.T @ truth).magnitude()
        assert off < 0.3 * Rotation.from_matrix(truth).magnitude()


def test_a_rest_is_sought_where_the_marker_rested_or_in_the_middle_of_its_motion(four, record):
    mechanism, window = Mechanism(four), record(four, 1, noise=0.0)[0]
    middle = rest_near(mechanism, four.nominal, prepare(window, four))
    assert middle is not None
    np.testing.assert_allclose(middle.marker_position(four.marker), window.markers[:, 0].mean(axis=0), atol=1e-6)
    aside = np.array([1.2, -0.1, -0.3])
    rested = rest_near(mechanism, four.nominal, prepare(replace(window, equilibrium=aside), four))
    assert rested is not None
    np.testing.assert_allclose(rested.marker_position(four.marker), aside, atol=1e-6)
    unreachable = replace(window, equilibrium=np.array([1.2, -0.1, 3.0]))
    assert rest_near(mechanism, four.nominal, prepare(unreachable, four)) is None


@pytest.mark.slow
def test_windows_that_nobody_read_are_begun_anew_once_the_others_tell_the_body(four, record, monkeypatch):
    """A rest of a wrong body may be turned so far that a cable is slack at once: the window would be lost."""
    windows = [replace(window, lengths=None) for window in record(four, 4)]
    found, guessed = fit_module.fit(Mechanism(four, native=True), windows), fit_module.first_guesses
    assert not found.journey.slack
    asked = []

    def turned(mechanism, body, recordings, theta):
        asked.append(body)
        guesses = list(guessed(mechanism, body, recordings, theta))
        if len(asked) == 1:
            away = Rotation.from_rotvec([0.5, -0.6, 0.9]).as_matrix()
            guesses[2] = replace(guesses[2], rotation=guesses[2].rotation @ away)
        return tuple(guesses)

    monkeypatch.setattr(fit_module, "first_guesses", turned)
    again = fit_module.fit(Mechanism(four, native=True), windows)
    assert len(asked) == 2
    assert not again.journey.slack
    np.testing.assert_allclose(again.values, found.values, atol=0.1 * found.sd.max())
