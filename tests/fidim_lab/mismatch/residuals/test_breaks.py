"""Breaks in what a fit leaves: faint spikes and steps are found, also behind gaps; motion, knocks and kinks are not."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fidim_lab.data.records import Campaign, Robot, Role, Window
from fidim_lab.identification.data_checks.screening import screen
from fidim_lab.identification.markers.displaced import ScoreLimits
from fidim_lab.identification.markers.finding import DefectKind, Finding
from fidim_lab.mismatch.cleaning.clean import Cleaned
from fidim_lab.mismatch.cleaning.off_motion import without_breaks
from fidim_lab.mismatch.residuals.break_rivals import Break, judge
from fidim_lab.mismatch.residuals.breaks import breaks_of
from fidim_lab.mismatch.residuals.residual import Leftover

LIMITS = ScoreLimits.for_tests(20_000)
RATES = [50.0, 100.0, 200.0]


def residual(rate: float, seed: int = 1, size: float = 8.0, seconds: float = 10.0) -> np.ndarray:
    """What a fit leaves where physics is missing: two slow oscillations, and noise of 1."""
    t = np.arange(round(seconds * rate)) / rate
    slow = size * np.sin(2 * np.pi * np.array([0.7, 1.1, 1.6]) * t[:, None] + np.arange(3))
    return slow + np.random.default_rng(seed).normal(size=(len(t), 3))


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_what_moves_smoothly_has_no_breaks(rate: float, seed: int) -> None:
    found = breaks_of(residual(rate, seed), 1 / rate, LIMITS)
    assert not found.spikes
    assert not found.steps


@pytest.mark.parametrize(("rate", "size"), [(50.0, 10.0), (100.0, 8.0), (200.0, 8.0)])
def test_a_faint_step_is_found_with_its_place_and_size(rate: float, size: float) -> None:
    values = residual(rate)
    at = round(0.47 * len(values))
    values[at:, 0] += size
    (row, by), *others = breaks_of(values, 1 / rate, LIMITS).steps
    assert not others
    assert row == at
    np.testing.assert_allclose(by, [size, 0.0, 0.0], atol=2.5)


def test_a_step_behind_a_frozen_run_might_be_a_blow_unless_the_marker_is_known_to_jump() -> None:
    values = residual(100.0, size=3.0)
    values[490:505] = np.nan
    assert not breaks_of(values, 0.01, LIMITS).steps
    values[505:, 1] += 20.0
    assert not breaks_of(values, 0.01, LIMITS).steps
    (row, by), *_ = breaks_of(values, 0.01, LIMITS, jumps=slice(0, 0)).steps
    assert row == 505
    np.testing.assert_allclose(by, [0.0, 20.0, 0.0], atol=4.0)


def test_a_place_after_which_nothing_is_seen_is_not_judged() -> None:
    """A peak whose samples an earlier one of the same look has taken along."""
    values = residual(100.0)
    values[900:] = np.nan
    assert judge(values, 0.01, 900).what is Break.NONE
    assert judge(values, 0.01, len(values) - 1).what is Break.NONE


@given(seed=st.integers(0, 2**32 - 1), many=st.sampled_from([0.01, 0.1, 0.4]), jumps=st.booleans())
@settings(max_examples=25, deadline=None)
def test_whatever_was_recorded_is_judged(seed: int, many: float, jumps: bool) -> None:
    rng = np.random.default_rng(seed)
    values = residual(50.0, seed % 1000, seconds=2.0)
    values += np.where(rng.random((len(values), 1)) < many, rng.normal(size=values.shape) * 200.0, 0.0)
    values[rng.random(len(values)) < many] = np.nan
    found = breaks_of(values, 0.02, LIMITS, spikes=LIMITS, jumps=slice(80, 100) if jumps else None)
    assert all(np.isfinite(values[row]).all() for row in found.spikes)
    assert all(0 < row < len(values) for row, _ in found.steps)


@pytest.mark.parametrize("rate", RATES)
def test_single_samples_are_found_and_nothing_beside_them(rate: float) -> None:
    values = residual(rate)
    rows = [100, 101, 240, 333]
    values[rows, [0, 1, 2, 0]] += [12.0, -12.0, 12.0, -9.0]
    found = breaks_of(values, 1 / rate, LIMITS)
    assert list(found.spikes) == rows
    assert not found.steps


@pytest.mark.parametrize("rows", [[999], [998, 999], [0], [0, 1]])
def test_samples_at_an_end_are_found_too(rows: list[int]) -> None:
    values = residual(100.0, size=3.0)
    values[rows, 0] += 25.0
    found = breaks_of(values, 0.01, LIMITS)
    assert set(found.spikes) >= set(rows)
    assert len(found.spikes) <= 3
    assert not found.steps


def test_a_sample_too_faint_for_any_marker_is_taken_from_one_known_to_be_faulty() -> None:
    values = residual(100.0, size=0.0)
    values[333, 0] = 5.5
    assert not breaks_of(values, 0.01, LIMITS).spikes
    assert breaks_of(values, 0.01, LIMITS, spikes=ScoreLimits(4.2, 4.7)).spikes == (333,)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_knock_that_the_body_felt_is_no_fault(seed: int) -> None:
    values = residual(100.0, seed)
    t = np.arange(len(values)) / 100.0
    for at in (2.0, 4.1, 6.3, 8.2):
        values += 60.0 * np.maximum(t - at, 0.0)[:, None] * np.array([1.0, -0.5, 0.3])
    found = breaks_of(values, 0.01, LIMITS)
    assert not found.spikes
    assert not found.steps


def test_a_quick_move_is_a_step_only_of_a_marker_known_to_jump() -> None:
    values = residual(100.0, size=0.0)
    share = np.clip((np.arange(len(values)) - 500) / 8 + 0.5, 0.0, 1.0)
    values[:, 0] += 12.0 * share
    assert judge(values, 0.01, 500).what is not Break.STEP
    assert judge(values, 0.01, 500, jumps=slice(0, 0)).what is Break.STEP


def test_where_samples_follow_no_polynomial_nothing_is_said() -> None:
    values = residual(100.0)
    values[500:, 0] += 8.0
    values[:, 0] += 8.0 * np.sin(2 * np.pi * 22.0 * np.arange(len(values)) / 100.0)
    assert not breaks_of(values, 0.01, LIMITS).steps


# ---- applied to a campaign


NOISE = 1e-4


@pytest.fixture
def cleaned(irma4: Robot) -> Cleaned:
    t = np.arange(1000) / 100.0
    markers = NOISE * np.stack([residual(100.0, 1, 0.0), residual(100.0, 2, 0.0)], axis=1)
    windows = tuple(Window(f"w{k}", Role.IDENTIFY, t, markers + 0.1 * k, None, None) for k in (1, 2))
    robot = replace(irma4, extra_markers=(np.array([0.1, 0.0, 0.0]),))
    campaign = Campaign("made", robot, 100.0, windows)
    return Cleaned(campaign, screen(campaign))


def left(cleaned: Cleaned, values: np.ndarray, rows: slice = slice(None), window: str = "w1") -> Leftover:
    return Leftover(window, cleaned.campaign.windows[0].t[rows], values[rows], NOISE, 8)


def changed(cleaned: Cleaned, seen: Leftover) -> Cleaned:
    found = without_breaks(cleaned, [seen])
    assert found is not None
    return found


def test_nothing_found_changes_nothing(cleaned: Cleaned) -> None:
    values = cleaned.campaign.windows[0].markers / NOISE - 1000.0
    assert without_breaks(cleaned, [left(cleaned, values)]) is None


def test_what_follows_a_step_becomes_missing_of_that_marker_alone(cleaned: Cleaned) -> None:
    values = cleaned.campaign.windows[0].markers / NOISE - 1000.0
    values[600:, 1, 2] += 9.0
    # a segment of the window: its rows are found by their times
    after = changed(cleaned, left(cleaned, values, slice(400, 800)))
    gone = np.asarray(np.isnan(after.campaign.windows[0].markers).all(axis=2))
    assert not gone[:, 0].any()
    np.testing.assert_array_equal(gone[:, 1], np.arange(1000) >= 600)
    assert after.campaign.windows[1] is cleaned.campaign.windows[1]
    (fault,) = after.faults
    assert (fault.kind, fault.window, fault.channel) == (DefectKind.JUMP, "w1", "m2z")
    assert fault.size == pytest.approx(9 * NOISE, rel=0.2)
    assert "marker 2 jumps by 0.87" in fault.says


def test_of_an_early_step_the_longer_part_is_kept_and_of_two_that_cancel_both_ends(cleaned: Cleaned) -> None:
    values = cleaned.campaign.windows[0].markers / NOISE - 1000.0
    values[100:, 0, 0] += 9.0
    gone = np.isnan(changed(cleaned, left(cleaned, values)).campaign.windows[0].markers[:, 0]).all(axis=1)
    np.testing.assert_array_equal(gone, np.arange(1000) < 100)
    values[500:, 0, 0] -= 9.0
    gone = np.isnan(changed(cleaned, left(cleaned, values)).campaign.windows[0].markers[:, 0]).all(axis=1)
    np.testing.assert_array_equal(gone, (np.arange(1000) >= 100) & (np.arange(1000) < 500))


def test_a_marker_with_many_spikes_is_looked_at_more_closely(cleaned: Cleaned) -> None:
    values = cleaned.campaign.windows[0].markers / NOISE - 1000.0
    values[700, 0, 1] = 5.5
    assert without_breaks(cleaned, [left(cleaned, values)]) is None
    spikes = tuple(Finding(DefectKind.SPIKE, "w2", "y", (k, k), 1e-3, "m", "off") for k in range(5))
    after = changed(replace(cleaned, faults=spikes), left(cleaned, values))
    assert [fault.t for fault in after.faults[5:]] == [(7.0, 7.0)]
    assert np.isnan(after.campaign.windows[0].markers[700, 0]).all()


def test_a_marker_that_jumped_in_other_windows_is_expected_to_at_the_same_time(cleaned: Cleaned) -> None:
    values = cleaned.campaign.windows[0].markers / NOISE - 1000.0
    values[600:, 0, 0] += 2.4
    assert without_breaks(cleaned, [left(cleaned, values)]) is None
    for times, found in (((5.9, 6.0, 6.06), 6.0), ((5.0, 6.0, 7.0), None)):
        jumps = [
            Finding(DefectKind.JUMP, f"w{k + 2}", "y", (time, 10.0), 1e-3, "m", "off") for k, time in enumerate(times)
        ]
        known = replace(cleaned, faults=tuple(jumps))
        after = without_breaks(known, [left(cleaned, values)]) or known
        assert [fault.t[0] for fault in after.faults[3:] if fault.t] == ([] if found is None else [found])


def test_one_of_two_first_samples_off_and_a_later_jump_leave_the_part_between_and_no_spikes_within_it(
    irma4: Robot,
) -> None:
    """Two bad samples at the begin look like a step: what follows them is no displaced stretch to the end."""
    t = np.arange(1000) / 100.0
    markers = 0.01 * np.sin(2.0 * t[:, None] + np.arange(3)) + NOISE * residual(100.0, 1, 0.0)
    markers[:2] += [-7e-3, 6e-4, 2e-3]
    markers[300, 2] += 3e-3
    markers[500:, 0] += 1.6e-3
    campaign = Campaign("made", irma4, 100.0, (Window("w1", Role.IDENTIFY, t, markers[:, None], None, None),))
    gone = np.isnan(screen(campaign).campaign.windows[0].markers[:, 0]).any(axis=1)
    np.testing.assert_array_equal(np.flatnonzero(~gone), [*range(2, 300), *range(301, 500)])
