"""Windows cut to their first seconds, and carried back to their whole length."""

from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.data.records import Robot, Role, Window
from fidim_lab.identification.mle.trajectories.recordings import prepare
from fidim_lab.mismatch.fitting.fit_data import shortened


def window(begin: float = 0.0, missing: int = 0) -> Window:
    t = begin + np.arange(1001) / 100
    markers = np.zeros((1001, 1, 3))
    markers[:missing] = np.nan
    lengths = np.full((1001, 4), 1.5)
    return Window("i01", Role.IDENTIFY, t, markers, lengths, None)


@pytest.mark.parametrize(("begin", "missing"), [(0.0, 0), (7.5, 0), (0.0, 50)])
def test_the_first_seconds_count_from_the_first_marker(begin: float, missing: int) -> None:
    short = shortened(window(begin, missing), 3.0)
    assert short.t[-1] == pytest.approx(begin + missing / 100 + 3.0)
    assert len(short.t) == len(short.markers)
    assert short.lengths is not None
    assert len(short.lengths) == len(short.t)


def test_a_window_without_a_marker_stays() -> None:
    empty = window(missing=1001)
    assert shortened(empty, 3.0) is empty


def test_a_cut_recording_keeps_begin_and_lengths(irma4: Robot) -> None:
    whole = prepare(replace(window(missing=20), lengths=np.linspace(1, 2, 4004).reshape(1001, 4)), irma4)
    part = whole.until(1.0)
    assert part.end == pytest.approx(1.0)
    assert part.begin == whole.begin
    assert np.array_equal(part.lengths, whole.lengths)
    assert len(part.markers) == len(part.t) == 101
