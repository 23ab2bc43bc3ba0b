"""What makes a recorded window a good one."""

import numpy as np
import pytest

from procedures.outcomes import Outcome, judge
from procedures.recording.recorder import WindowRecording
from procedures.recording.window_check import moving_average, seen_samples, window_measurements
from procedures.steps import WindowLimits

LIMITS = WindowLimits(
    complete=0.98,
    longest_gap=0.1,
    jump=5e-3,
    drift=0.03,
    amplitude=5e-3,
    displacement=(0.1, 0.1),
    displacement_tolerance=1.25,
    motors_still=3e-3,
    encoder_error=1e-3,
    tension=(20.0, 200.0),
    overload=250.0,
    tension_over=0.05,
)


def recording(*, amplitude=0.03, tension=60.0):
    t = np.arange(1001) / 100.0
    rng = np.random.default_rng(3)
    swing = amplitude * np.cos(2 * np.pi * 1.3 * t)
    place = np.column_stack([1.2 + swing, -0.2 + 0.4 * swing, np.full(1001, -0.3)]) + rng.normal(0, 1e-4, (1001, 3))
    lengths = np.full((1001, 4), 1.4)
    currents = np.full((1001, 4), tension / 34.0) + rng.normal(0, 0.05, (1001, 4))
    arrivals = 5.0 + t + rng.exponential(1e-3, 1001)
    return WindowRecording("i01", 1, 100.0, place[:, None, :], lengths, currents, {}, arrivals)


def verdict(made):
    return judge(window_measurements(made, LIMITS, (1.4,) * 4, (1.2, -0.2, -0.3), (34.0,) * 4))


def test_a_good_window_passes():
    assert verdict(recording()) == (Outcome.PASS, "")


def _lose(made, rows):
    """Frames that never came: the whole row is blank."""
    for part in (made.markers, made.lengths, made.currents):
        part[rows] = np.nan


def _shift(rows, seconds):
    return lambda made: made.arrivals.__setitem__(rows, made.arrivals[rows] + seconds)


CASES = {
    "numbers that begin to lag": (_shift(slice(400, None), 0.3), Outcome.FAIL, "this computer's clock is 0.3 s"),
    "numbers that jump ahead": (_shift(slice(900, None), -0.3), Outcome.FAIL, "this computer's clock is 0.3 s"),
    "frames that the computer takes late": (_shift(slice(400, 440), 0.3), Outcome.PASS, ""),
    "no frame at all": (lambda r: r.arrivals.fill(np.nan), Outcome.UNSET, "frame numbers"),
    "lost frames": (lambda r: _lose(r, slice(0, 1000, 20)), Outcome.FAIL, "part of marker samples"),
    "stale winch": (
        lambda r: r.lengths[600:700, 0].fill(np.nan),
        Outcome.FAIL,
        "part of winch samples that are there is 0.9",
    ),
    "gap": (
        lambda r: r.markers.__setitem__(slice(300, 320), np.nan),
        Outcome.FAIL,
        "longest gap of the marker is 0.2 s",
    ),
    "not where it was sent": (
        lambda r: r.lengths.__setitem__((slice(None), 1), 1.402),
        Outcome.FAIL,
        "encoder error of cable 2 is 2 mm",
    ),
    "a wrong sample": (
        lambda r: r.markers.__setitem__((500, 0, 1), r.markers[500, 0, 1] + 8e-3),
        Outcome.FAIL,
        "largest jump of marker 1 is ",
    ),
    "taken for another": (
        lambda r: r.markers.__setitem__(slice(300, 400), r.markers[300:400] + 0.03),
        Outcome.FAIL,
        "largest jump of marker 1 is ",
    ),
    "frozen": (
        lambda r: r.markers.__setitem__(slice(300, 320), r.markers[299]),
        Outcome.FAIL,
        "is 0.2 s (at most 0.1 s",
    ),
    "old places under new numbers": (
        lambda r: r.markers.__setitem__(slice(300, 377), r.markers[223:300]),
        Outcome.FAIL,
        "longest repetition of earlier places of the marker is 0.77 s (at most 0.1 s",
    ),
    "a stream that falls behind under new numbers": (
        lambda r: r.markers.__setitem__(slice(377, None), r.markers[300:-77].copy()),
        Outcome.FAIL,
        "longest repetition of earlier places of the marker is 0.77 s (at most 0.1 s",
    ),
    "a stream of few digits": (lambda r: r.markers.__setitem__(..., r.markers.round(4)), Outcome.PASS, ""),
    "a few lost": (lambda r: r.markers.__setitem__(slice(0, 950, 100), np.nan), Outcome.PASS, ""),
    "many lost": (lambda r: r.markers.__setitem__(slice(0, 1000, 20), np.nan), Outcome.FAIL, "part of marker samples"),
    "nothing seen": (lambda r: r.markers.fill(np.nan), Outcome.FAIL, "amplitude (peak to peak) was not measured"),
    "motor gave way": (
        lambda r: r.lengths[:, 2].__isub__(np.linspace(0, 4e-3, 1001)),
        Outcome.FAIL,
        "motor of cable 3 is 4 mm",
    ),
    "motor gave way a little": (
        lambda r: r.lengths[:, 2].__isub__(np.linspace(0, 2e-3, 1001)),
        Outcome.MARGINAL,
        "cable 3",
    ),
    "slack": (
        lambda r: r.currents[500:530, 1].fill(-0.1),
        Outcome.FAIL,
        "smallest tension of cable 2 (limit 20 N) is -3.4 N",
    ),
    "nearly slack": (
        lambda r: r.currents[500:530, 1].fill(0.1),
        Outcome.MARGINAL,
        "smallest tension of cable 2 (limit 20 N) is 3.4 N",
    ),
    "beyond the upper limit": (
        lambda r: r.currents[500:530, 2].fill(6.5),
        Outcome.MARGINAL,
        "largest tension of cable 3 (limit 200 N) is 221 N",
    ),
    "overloaded": (
        lambda r: r.currents[500:530, 2].fill(7.5),
        Outcome.FAIL,
        "largest tension of cable 3 (limit 200 N)",
    ),
    "one bad current": (lambda r: r.currents.__setitem__((500, 1), -1.0), Outcome.PASS, ""),
    "no currents": (lambda r: r.currents.fill(np.nan), Outcome.FAIL, "smallest tension was not measured"),
    "too far": (
        lambda r: r.markers[400, 0].__setitem__(0, 1.33),
        Outcome.FAIL,
        "displacement x is 130 mm (at most 125 mm",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_what_is_wrong_is_said(case):
    spoil, outcome, says = CASES[case]
    made = recording()
    spoil(made)
    found, reason = verdict(made)
    assert found is outcome
    assert says in reason
    assert ("winch samples" in reason) == (case in ("stale winch", "no currents"))


@pytest.mark.parametrize(
    ("amplitude", "outcome"), [(0.001, Outcome.FAIL), (0.11, Outcome.MARGINAL), (0.13, Outcome.FAIL)]
)
def test_amplitude_has_a_floor_and_a_limit(amplitude, outcome):
    assert verdict(recording(amplitude=amplitude))[0] is outcome


def test_an_unknown_rest_does_not_pass():
    outcome, reason = judge(window_measurements(recording(), LIMITS, (1.4,) * 4, (), (34.0,) * 4))
    assert outcome is Outcome.UNSET
    assert "displacement x was not measured" in reason


def test_four_equal_positions_are_chance_five_are_frozen():
    place = np.arange(60.0).reshape(20, 3)
    place[5:9] = place[5]
    assert seen_samples(place).all()
    place[9] = place[5]
    assert np.flatnonzero(~seen_samples(place)).tolist() == [6, 7, 8, 9]


def test_moving_average_leaves_blanks_out():
    assert moving_average(np.array([1.0, np.nan, 3.0, np.nan, np.nan]), 2) == pytest.approx(
        [1.0, 3.0, 3.0, np.nan], nan_ok=True
    )
