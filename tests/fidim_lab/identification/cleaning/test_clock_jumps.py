"""A clock that jumps while the markers go on is cut; rows that are missing are not."""

import numpy as np
import pytest

from fidim_lab.data.records import Campaign, Robot, Role, Window
from fidim_lab.identification.cleaning.clean import without_bad_samples
from fidim_lab.identification.cleaning.clock_jumps import without_clock_jumps


def window(name: str, *, place: float = 0.0, amplitude: float = 0.05, unit: float = 1.0) -> Window:
    t = np.arange(600) / 100
    rng = np.random.default_rng(len(name))
    swing = np.stack([np.sin(14 * t), np.sin(11 * t + 1), 0.2 * np.sin(25 * t)], axis=1)
    markers = np.array([1.2, -0.1, -0.3 - place]) + amplitude * swing + 1e-4 * rng.normal(size=(600, 3))
    return Window(name, Role.IDENTIFY, t, unit * markers[:, None], np.full((600, 4), 1.5 + place), None)


def campaign(robot: Robot, *windows: Window) -> Campaign:
    return Campaign("made up", robot, 100.0, windows)


def jumping(by: float) -> Window:
    whole = window("i01")
    return Window("i01", whole.role, whole.t + by * (np.arange(600) >= 200), whole.markers, whole.lengths, None)


def with_blank_rows(window: Window) -> Window:
    """As importers write a gap: a row for each sample that is not there."""
    at = np.rint(100 * window.t).astype(int)
    markers = np.full((at[-1] + 1, *window.markers.shape[1:]), np.nan)
    markers[at] = window.markers
    return Window(window.id, window.role, np.arange(len(markers)) / 100, markers, np.full((len(markers), 4), 1.5), None)


@pytest.mark.parametrize("cleaned", [without_clock_jumps, without_bad_samples])
@pytest.mark.parametrize("by", [0.02, 0.1, 0.5, 3.0])
def test_a_jump_of_the_clock_is_cut_out_with_its_time(irma4, by, cleaned):
    found = cleaned(campaign(irma4, jumping(by), window("i02", place=0.1)))
    (note,) = found.notes
    assert f"Window i01: the time stamps jump by {by + 0.01:.3f} s at 1.99 s" in note
    kept = found.campaign.windows[0]
    assert len(kept.t) == 400
    assert kept.lengths is not None
    assert len(kept.lengths) == 400


@pytest.mark.parametrize("by", [0.02, 0.1, 0.5, 3.0])
def test_a_jump_over_blank_rows_is_one_too(irma4, by):
    found = without_clock_jumps(campaign(irma4, with_blank_rows(jumping(by)), window("i02", place=0.1)))
    assert f"jump by {by + 0.01:.3f} s at 1.99 s" in found.notes[0]
    kept = found.campaign.windows[0]
    assert len(kept.t) == 400
    assert kept.t[0] == pytest.approx(2.0 + by)


def test_a_platform_that_hardly_moves_shows_no_jump(irma4):
    """Where it is hidden for a second, it is afterwards where it was, whatever the clock did."""
    still = window("i01", amplitude=2e-5)
    still.markers[300:400] = np.nan
    assert without_clock_jumps(campaign(irma4, still, window("i02", place=0.1))).notes == ()


@pytest.mark.parametrize("blank", [False, True])
@pytest.mark.parametrize("lost", [2, 5, 20, 33, 77])
def test_missing_rows_are_no_jump(irma4, lost, blank):
    whole = window("i01")
    kept = (np.arange(600) < 200) | (np.arange(600) >= 200 + lost)
    assert whole.lengths is not None
    holed = Window("i01", whole.role, whole.t[kept], whole.markers[kept], whole.lengths[kept], None)
    found = without_clock_jumps(campaign(irma4, with_blank_rows(holed) if blank else holed, window("i02", place=0.1)))
    assert found.notes == ()
    assert found.campaign.windows[0].t.size == (600 if blank else 600 - lost)
