"""A soft push at the same moment of every window, and physics that is missing, which is none."""

import numpy as np
import pytest

from fidim_lab.mismatch.cleaning.common_push import _moment, find_common_push


@pytest.mark.parametrize(
    ("shape", "expected"),
    [
        (lambda t: 4000 * (1 - np.abs(t - 7.0) / 6), 7.0),  # falls off on both sides at once
        (lambda t: 4000 * 4 * t * (10 - t) / 100, None),  # a hill over the whole window
        (lambda t: 60 * (1 - np.abs(t - 7.0) / 6), None),  # too little in all
        (lambda t: 4000 * np.where(t > 7.0, 1 - (t - 7.0) / 3, 1.0), None),  # no better there than any time before
    ],
)
def test_a_moment_is_told_from_a_hill(shape, expected: float | None) -> None:
    at = np.arange(0.75, 9.26, 0.25)
    times = np.column_stack([np.repeat(at, 2), np.column_stack([at, at + 0.25]).ravel()])
    assert _moment(times, shape(times[:, 0])) == expected


def test_windows_shorter_than_a_second_away_have_no_moment() -> None:
    at = np.array([0.75, 1.0, 1.25])
    assert _moment(np.column_stack([at, at]), np.array([0.0, 500.0, 0.0])) is None


def test_a_push_too_soft_for_segments_is_found_in_every_window(baseline_of) -> None:
    start = baseline_of("hand-contact:fx=0.04,fy=0.03,start=6.0,stop=6.6,window=0", seed=12, windows=5, seconds=10.0)
    found = find_common_push(start.as_it_is, start.held_out)
    assert {push.window for push in found} == {"i01", "i02", "i03", "i04", "i05", "v01"}
    assert {(push.begin, push.end) for push in found} == {(found[0].begin, found[0].end)}
    assert 5.4 < found[0].begin < 6.3 < found[0].end < 7.2
    gains = [push.gain or 0.0 for push in found]
    assert len(set(gains)) == len(gains)  # each its own


def test_missing_physics_is_no_push(baseline_of) -> None:
    start = baseline_of("air-drag-linear:c=0.02", seed=12, windows=5, seconds=10.0)
    assert not find_common_push(start.as_it_is, start.held_out)
