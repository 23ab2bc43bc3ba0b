"""Pictures: no peak is lost, the same bytes, names that are not maths, identifiers that do not meet."""

import re

import matplotlib as mpl
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fidim_lab.app.report.drawings import figures
from fidim_lab.app.report.drawings.figures import Bar, Bout, Course
from fidim_lab.app.report.drawings.svg import POINTS, distinct, thin

T = np.arange(0, 10, 0.01)
WAVE = np.stack([np.sin(T), np.cos(T), np.sin(3 * T)], axis=1)


@given(st.integers(1, 5000), st.integers(0, 2**32 - 1))
@settings(max_examples=50, deadline=None)
def test_thinning_keeps_every_peak_and_the_order(samples, seed):
    rng = np.random.default_rng(seed)
    t, values = np.arange(float(samples)), rng.normal(size=samples)
    values[rng.random(samples) < 0.2] = np.nan
    times, kept = thin(t, values)
    assert len(times) <= max(POINTS, 1)
    assert np.all(np.diff(times) > 0)
    np.testing.assert_array_equal(kept, values[times.astype(int)])
    if np.isfinite(values).any():
        assert (np.nanmax(kept), np.nanmin(kept)) == (np.nanmax(values), np.nanmin(values))


def test_a_long_gap_stays_a_gap():
    values = np.sin(T)
    values[300:500] = np.nan
    times, kept = thin(T, values)
    assert np.isnan(kept[(times > 3.05) & (times < 4.95)]).all()


def test_the_same_data_give_the_same_bytes_whatever_the_users_settings():
    draw = figures.trajectory
    once = draw(Course(T, WAVE), None, Course(T, 0.9 * WAVE))
    with mpl.rc_context({"font.size": 30, "axes.facecolor": "red"}):
        assert draw(Course(T, WAVE), None, Course(T, 0.9 * WAVE)) == once
        assert mpl.rcParams["font.size"] == 30


def test_no_address_and_no_size_is_left():
    svg = figures.tensions(T, np.abs(WAVE) * 50, (20.0, 200.0))
    assert "http" not in svg
    assert re.match(r'<svg viewBox="[\d. ]+">', svg)
    assert not re.search(r"\d\.\d{3,}[ \"]", svg)  # hundredths of a point are enough


def test_the_upper_limit_is_drawn_where_it_is_near():
    near, far = (figures.tensions(T, level + np.abs(WAVE), (20.0, 200.0)) for level in (150.0, 50.0))
    dotted = "stroke-dasharray: 0.9"
    assert near.count(dotted) == far.count(dotted) + 1


def test_identifiers_of_two_pictures_do_not_meet():
    bars = [Bar("v01", 0.1, True)]
    one, two = (distinct(figures.cross_validation(bars, 0.06, 0.09), prefix) for prefix in ("a", "b"))
    ids = [set(re.findall(r' id="([^"]*)"', svg)) for svg in (one, two)]
    assert ids[0]
    assert not ids[0] & ids[1]
    assert set(re.findall(r'(?:url\(|href=")#([^)"]+)', one)) == ids[0]


@pytest.mark.parametrize("name", ["a$b$c", r"$\frac$", "<b>&", "窓", "", "x" * 400, "two\nlines", "\x01"])
def test_any_name_can_be_drawn(name):
    svg = figures.cross_validation([Bar(name, 0.1, True), Bar("v02", 0.2, False)], None, None)
    svg += figures.timeline([name, "v02"], ("moving",), [Bout(name, "moving", 0.0, 2.0)], [1.0])
    assert "<b>" not in svg
    assert len(svg) < 60_000


def test_a_marker_that_was_never_seen_can_be_drawn():
    nothing = np.full_like(WAVE, np.nan)
    assert "<svg" in figures.trajectory(Course(T, nothing), None, None)
    assert "<svg" in figures.tensions(T, nothing, (20.0, 200.0))
    assert "<svg" in figures.residuals(T, (T, nothing), Course(T, nothing))


def test_a_run_in_which_nothing_was_done_can_be_drawn():
    assert "<svg" in figures.timeline(["i01"], ("moving",), [], [])
