"""A look after every window: what holds, what is suspected, and that it is what a look at all windows at once says."""

from dataclasses import replace

import pytest

from fidim_lab.mismatch.online_monitor import Watch
from fidim_lab.mismatch.thresholds import SHARED


@pytest.fixture(scope="module")
def windows_of(campaign_of):
    def made(*texts, count=4):
        return campaign_of(*texts, seed=5, windows=4, seconds=3.0).windows[:count]

    return made


def test_windows_without_hidden_physics_hold(irma4, windows_of):
    watch = Watch(irma4, native=True)
    said = [watch.look([window]) for window in windows_of()]
    assert [one.chi2_per_dof is None for one in said] == [True, True, False, False]
    assert f"{SHARED.fewest} are needed" in said[0].says
    assert said[-1].holds
    assert said[-1].windows == 4
    assert said[-1].chi2_per_dof == pytest.approx(1.0, abs=0.15)
    assert "the model holds" in said[-1].says


@pytest.mark.slow
def test_drag_is_suspected_window_by_window_as_at_once(irma4, windows_of):
    windows = windows_of("air-drag-linear:c=0.5")
    watch = Watch(irma4, native=True)
    watch.look(windows[:3])
    last = watch.look(windows[3:])
    assert not last.holds
    assert last.suspected[0].id == "air-drag-linear"
    assert "suspected: air-drag-linear" in last.says
    assert last.suspected[0].would_leave < last.chi2_per_dof
    once = Watch(irma4, native=True).look(windows)
    assert last.chi2_per_dof == pytest.approx(once.chi2_per_dof, rel=0.01)
    assert last.suspected[0].log_evidence == pytest.approx(once.suspected[0].log_evidence, rel=0.05)


def test_a_window_of_another_robot_is_said_at_once(irma4, windows_of):
    window = windows_of(count=1)[0]
    swapped = replace(window, lengths=window.lengths[:, [1, 0, 2, 3]])
    said = Watch(irma4, native=True).look([swapped])
    assert not said.holds
    assert "do not belong together" in said.says


@pytest.mark.parametrize("hidden", ["air-drag-linear:c=0.5", "gravity-tilt:rx=0.02"])
@pytest.mark.slow
def test_what_was_done_on_the_first_two_windows_changes_hardly_anything_that_is_told(irma4, windows_of, hidden):
    windows = windows_of(hidden, count=3)
    one_by_one = Watch(irma4, native=True)
    last = [one_by_one.look([window]) for window in windows][-1]
    once = Watch(irma4, native=True).look(windows)
    assert last.chi2_per_dof == pytest.approx(once.chi2_per_dof, rel=1e-3)
    assert [one.id for one in last.suspected] == [one.id for one in once.suspected]
    for one, other in zip(last.suspected, once.suspected, strict=True):
        assert one.log_evidence == pytest.approx(other.log_evidence, rel=0.05)
