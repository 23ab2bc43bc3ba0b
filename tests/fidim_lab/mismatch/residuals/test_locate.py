"""White remainders are called white as often as stated; structure is found with window, time, channel, frequency."""

from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.data.records import Motion
from fidim_lab.mismatch.residuals.locate import goes_along, locate, strongest_line
from fidim_lab.mismatch.residuals.residual import Leftover
from fidim_lab.mismatch.residuals.whiteness import spectrum, whiteness

T = np.arange(1001) / 100


def directions(random: np.random.Generator) -> np.ndarray:
    """(T, 1, 3, 10): what a start's ten unknowns do, oscillations of two modes that grow or not, and shifts."""
    columns = [np.ones((len(T), 1, 1)) * random.normal(size=(1, 1, 3)) for _ in range(2)]
    for f in random.uniform(1.1, 3.4, 2):
        for wave in (np.sin(2 * np.pi * f * T), np.cos(2 * np.pi * f * T)):
            columns += [(wave * growth)[:, None, None] * random.normal(size=(1, 1, 3)) for growth in (1, T / 5)]
    return np.stack(columns, axis=-1)


def noise(count: int, seed: int, exact: bool = True) -> list[Leftover]:
    """White noise with the fit of ten unknowns per window projected out."""
    random = np.random.default_rng(seed)
    found = []
    for w in range(count):
        by = directions(random)
        q = np.linalg.qr(by.reshape(-1, by.shape[-1]))[0]
        x = random.normal(size=3 * len(T))
        x = (x - q @ (q.T @ x)).reshape(len(T), 1, 3)
        found.append(Leftover(f"w{w + 1}", T, x, 1e-4, 10, directions=by if exact else None))
    return found


def with_added(found: list[Leftover], w: int, added: np.ndarray) -> list[Leftover]:
    one = found[w]
    found[w] = Leftover(one.window, one.t, one.values + added, one.noise, one.own, one.motion)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("exact", [True, False])
def test_false_alarms_of_whiteness_are_as_stated(exact):
    """30 campaigns of 3 windows: 5 % are 1.5; eight or more have a chance of 2e-4."""
    p = np.array([whiteness(noise(3, seed, exact)).p_value for seed in range(30)])
    assert (p < 0.05).sum() < 8
    assert (p > 1e-3).all()
    assert np.median(p) > 0.2


def test_chi2_of_the_spectrum_is_that_of_the_samples():
    one = noise(1, 3, exact=False)[0]
    assert spectrum(one).chi2.sum() == pytest.approx(one.chi2)
    assert spectrum(one).dof.sum() == pytest.approx(one.count)
    assert spectrum(noise(1, 3)[0]).dof.sum() == pytest.approx(one.count - 10, abs=0.1)


def test_gaps_and_a_wrong_declared_noise_do_not_make_it_coloured():
    random = np.random.default_rng(8)
    found = []
    for w in range(6):
        x = 2.0 * random.normal(size=(len(T), 1, 3))
        x[200:260] = np.nan
        x[random.random(len(T)) < 0.05] = np.nan
        found.append(Leftover(f"w{w}", T, x, 1e-4, 10))
    answer = whiteness(found)
    assert answer.is_white
    assert answer.level == pytest.approx(2.0, rel=0.05)


def test_weak_structure_of_all_windows_is_seen_where_the_global_figure_is_blind():
    random = np.random.default_rng(2)
    found = noise(6, 40)
    for w in range(6):
        wave = 0.3 * np.sin(2 * np.pi * 1.7 * T + random.uniform(0, 6))
        with_added(found, w, wave[:, None, None] * np.array([1.0, 0.5, 0.0]))
    chi2 = sum(one.chi2 for one in found) / sum(one.count for one in found)
    answer = whiteness(found)
    assert chi2 < 1.05
    assert not answer.is_white
    assert answer.band[0] <= 1.75
    assert answer.band[1] >= 1.65
    assert "not white" in answer.says


def test_cameras_that_shake_faster_than_the_platform_swings_are_no_noise():
    found = noise(6, 3)
    for w in range(6):
        wave = 0.5 * np.sin(2 * np.pi * 23.4 * T + w)
        with_added(found, w, wave[:, None, None] * np.array([0.8, 0.6, 0.0]))
    answer = whiteness(found)
    assert answer.vibration == pytest.approx(23.4, abs=0.25)
    assert "Hz, faster than the platform swings" in answer.says


def test_white_noise_is_rarely_a_vibration():
    assert sum(whiteness(noise(6, seed, exact=False)).vibration is not None for seed in range(60)) == 0


def test_uneven_noise_is_white_by_its_shape():
    shape = np.diag([2.0, 1.0, 0.5])[np.newaxis]
    uneven = [replace(one, values=one.values @ np.linalg.inv(shape[0]), directions=None) for one in noise(6, 5)]
    assert not whiteness(uneven).is_white
    assert whiteness([replace(one, evening=shape) for one in uneven]).is_white


def test_noise_has_no_place():
    assert all(locate(noise(6, seed, exact=False)) == () for seed in range(8))


def test_a_burst_is_located():
    burst = np.where((T >= 4) & (T < 5.5), 3 * np.sin(2 * np.pi * 2.4 * T + 0.5), 0.0)
    added = burst[:, None, None] * np.array([0.1, 1.0, 0.2])
    found = locate(with_added(noise(6, 1, exact=False), 3, added))
    assert [where.window for where in found] == ["w4"]
    assert found[0].channel == "y"
    assert found[0].t == pytest.approx((4.0, 5.5), abs=0.35)
    assert found[0].frequency == pytest.approx(2.4, abs=0.15)
    assert found[0].share > 0.5
    assert "Window w4" in found[0].says


def test_line_with_frequency_phase_and_amplitude():
    wave = 2 * np.sin(2 * np.pi * 1.37 * T + 0.8)
    one = with_added(noise(1, 6, exact=False), 0, wave[:, None, None] * np.array([0.0, 0.0, 1.0]))[0]
    line = strongest_line(one, 2)
    assert line.frequency == pytest.approx(1.37, abs=0.01)
    assert line.phase == pytest.approx(0.8, abs=0.3)
    assert line.amplitude == pytest.approx(2.0, abs=0.2)
    assert line.chance < 1e-12


def test_the_chance_of_a_line_in_noise_is_as_stated():
    chances = np.array([strongest_line(one, k).chance for one in noise(30, 9, exact=False) for k in range(3)])
    assert (chances < 0.05).sum() <= 12
    assert chances.min() > 1e-5


def test_what_the_residual_goes_along_with_is_named():
    twists = np.zeros((len(T), 6))
    twists[:, 0] = 0.3 * np.cos(2 * np.pi * 1.3 * T)
    twists[:, 1] = 0.3 * np.cos(2 * np.pi * 2.1 * T)
    positions = np.cumsum(twists[:, :3], axis=0) / 100
    motion = Motion(T, positions, np.tile(np.eye(3), (len(T), 1, 1)), twists, np.zeros_like(twists))
    random = np.random.default_rng(0)
    x = random.normal(size=(len(T), 1, 3))
    x[:, 0, 0] += 10 * twists[:, 1]
    found = goes_along(Leftover("w1", T, x, 1e-4, 10, motion), 0)
    assert {companion.name for companion in found[:2]} == {"the velocity in y", "the position in y"}
    assert found[0].correlation > 0.8


def test_nothing_to_test_is_white_and_nowhere():
    assert whiteness([]).p_value == 1.0
    assert locate([]) == ()


def test_a_drift_is_no_line_of_less_than_one_cycle():
    found = with_added(noise(1, 4, exact=False), 0, np.zeros((len(T), 1, 3)) + 3 * (T / T[-1])[:, None, None])
    assert strongest_line(found[0], 0).frequency >= 1 / (T[-1] + 0.01)
    assert all(where.frequency is None or where.frequency > 0.09 for where in locate(found))
