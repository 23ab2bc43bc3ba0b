import numpy as np
import pytest

from fidim_lab.arrays import runs
from fidim_lab.errors import SetupError
from fidim_lab.identification.motion.filters import PAPER, Derivatives, Edges, FilterDesign
from fidim_lab.identification.motion.signals import smooth, uniform

RATE = 100.0
T = np.arange(1001) / RATE


def oscillation(t):
    w = 2 * np.pi * np.array([2.1, 2.8])
    x = np.sin(np.outer(t, w))
    return 1.2 + x, w * np.cos(np.outer(t, w)), -(w**2) * x


def test_an_oscillation_keeps_its_value_and_derivatives():
    x, v, a = oscillation(T)
    found = smooth(uniform(T, x, RATE), FilterDesign())
    use = found.usable
    assert use.sum() == 1001 - 2 * 60
    np.testing.assert_allclose(found.value[use], x[use], atol=2e-4)
    np.testing.assert_allclose(found.first[use], v[use], atol=2e-4 * 20)
    np.testing.assert_allclose(found.second[use], a[use], atol=2e-4 * 400)


def test_the_papers_differences_are_biased_where_ours_are_not():
    x, _, a = oscillation(T)
    ours, papers = (smooth(uniform(T, x, RATE), spec) for spec in (FilterDesign(), PAPER))
    middle = slice(100, 900)
    assert np.abs(papers.second[middle] - a[middle]).max() > 10 * np.abs(ours.second[middle] - a[middle]).max()


def test_reflection_keeps_the_ends_but_bends_them():
    x, _, a = oscillation(T)
    found = smooth(uniform(T, x + 0.3 * np.cos(2 * np.pi * T)[:, None], RATE), FilterDesign(edges=Edges.REFLECT))
    assert found.usable.all()
    truth = a - 0.3 * (2 * np.pi) ** 2 * np.cos(2 * np.pi * T)[:, None]
    error = np.abs(found.second - truth).max(axis=1)
    assert error[:3].max() > 20 * np.median(error)


def test_a_short_gap_is_interpolated_and_said():
    x, _, _ = oscillation(T)
    holed = x.copy()
    holed[500:504, 0] = np.nan
    track = uniform(T, holed, RATE)
    np.testing.assert_allclose(track.values, x, atol=2e-4)
    assert track.notes == ("4 missing values in gaps of up to 0.05 s interpolated",)


def test_a_long_gap_is_cut_out_with_half_a_kernel_on_both_sides():
    x, v, _ = oscillation(T)
    holed = x.copy()
    holed[500:520] = np.nan
    found = smooth(uniform(T, holed, RATE), FilterDesign())
    unusable = runs(~found.usable)
    assert unusable == [(0, 60), (440, 580), (941, 1001)]
    np.testing.assert_allclose(found.first[found.usable], v[found.usable], atol=4e-3)


def test_absent_rows_are_gaps_like_any_other():
    x, _, _ = oscillation(T)
    keep = np.ones(len(T), dtype=bool)
    keep[[300, 301]] = False
    keep[600:650] = False
    track = uniform(T[keep], x[keep], RATE)
    assert len(track.t) == len(T)
    np.testing.assert_allclose(track.values[300:302], x[300:302], atol=3e-4)
    assert np.isnan(track.values[600:650]).all()
    assert any("50 samples (0.50 s)" in note for note in track.notes)


def test_nothing_is_extrapolated_at_the_ends():
    x, _, _ = oscillation(T)
    holed = x.copy()
    holed[:3] = np.nan
    assert np.isnan(uniform(T, holed, RATE).values[:3]).all()


def test_jittering_stamps_are_brought_to_the_grid_and_said():
    jitter = 1e-3 * np.random.default_rng(3).uniform(-1, 1, len(T))
    jitter[[0, -1]] = 0
    x, _, _ = oscillation(T + jitter)
    track = uniform(T + jitter, x, RATE)
    np.testing.assert_allclose(track.values, oscillation(track.t)[0], atol=2e-4)
    assert "off an even grid" in track.notes[0]


def test_a_wrong_sample_rate_is_named():
    with pytest.raises(SetupError, match=r"every 0\.01 s, the campaign says 50 Hz"):
        uniform(T, oscillation(T)[0], 50.0)


def test_a_recording_shorter_than_the_kernel_between_gaps_gives_nothing():
    x, _, _ = oscillation(T)
    holed = x.copy()
    holed[50::100] = np.nan
    holed[51::100] = np.nan
    holed[52::100] = np.nan
    for k in range(53, 58):
        holed[k::100] = np.nan
    assert not smooth(uniform(T, holed, RATE), FilterDesign()).usable.any()


@pytest.mark.parametrize("derivatives", list(Derivatives))
def test_both_ways_of_differentiating_agree_on_slow_signals(derivatives):
    x = np.sin(T)[:, None]
    found = smooth(uniform(T, x, RATE), FilterDesign(derivatives=derivatives))
    np.testing.assert_allclose(found.second[100:-100, 0], -np.sin(T)[100:-100], atol=1e-3)
