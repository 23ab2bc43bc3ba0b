"""Lengths of a row: those of its own instant, though a drive tells them once in a bus cycle."""

import pytest

from drivers.ports import DriveState, WinchSample
from procedures.recording.recorder import AHEAD, length_at


def sample(velocity, *, arrived=False):
    return WinchSample(10.0, DriveState.OPERATION_ENABLED, 1.5, velocity, 2.0, arrived)


@pytest.mark.parametrize(
    ("newest", "t", "length"),
    [
        (sample(0.2), 10.004, 1.5008),
        (sample(-0.2), 10.004, 1.4992),
        (sample(0.2), 9.999, 1.4998),  # sampled after the frame came, and read before it was taken in
        (sample(0.2), 11.0, 1.5 + 0.2 * AHEAD),  # not carried on for ever
        (sample(0.2, arrived=True), 10.004, 1.5),
        (sample(0.004), 10.004, 1.5),  # what a drive tells of a motor at rest
    ],
)
def test_a_winch_that_moves_is_carried_on_to_the_instant_of_the_frame(newest, t, length):
    assert length_at(newest, t) == pytest.approx(length, abs=1e-12)
