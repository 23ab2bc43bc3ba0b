"""Tension calibration against winches of our own making: known gain, offset, friction; poses that tell little."""

from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.data.records import Role, Window
from fidim_lab.data.robot_file import PAPERS_ROBOT, read_robot
from fidim_lab.errors import RefusedError
from fidim_lab.identification.calibration.tension_calibration import (
    Rests,
    TensionReading,
    calibrate,
    rests_of,
    rests_of_readings,
)
from fidim_lab.identification.random_plan import random_plan
from fidim_lab.model.equilibria import pose_from_lengths
from fidim_lab.model.mechanism import Mechanism
from procedures.expected.tensions import by_current
from procedures.settings import TensionBand

GAIN, OFFSET, FRICTION, NOISE = 34.0, 1.5, 3.0, 0.02


def made(count, rng, span=(20.0, 60.0), noise=NOISE):
    tension = rng.uniform(*span, (count, 1))
    direction = rng.choice([-1.0, 1.0], (count, 1))
    current = (tension - OFFSET - FRICTION * direction) / GAIN + noise * rng.standard_normal((count, 1))
    return Rests(tension, current, direction)


def test_gain_offset_and_friction_are_found_within_their_spread():
    off = []
    for seed in range(200):
        (found,) = calibrate(made(12, np.random.default_rng(seed)))
        assert found.problem == ""
        off.append([(found.gain - GAIN) / found.sd_gain, (found.offset - OFFSET) / found.sd_offset])
    assert np.abs(np.mean(off, axis=0)).max() < 0.35
    assert np.std(off, axis=0) == pytest.approx([1.15, 1.15], abs=0.2)  # Student, 9 degrees of freedom: 1.13


def told(found, current, moved=0):
    """The band of tensions that a run reads from a motor current by this calibration."""
    band = TensionBand(found.directed, found.load_friction, found.scatter) if moved else TensionBand(found.friction)
    known = by_current(found.gain * current + found.offset, moved, band)
    return known.value - known.band, known.value + known.band


def test_the_band_holds_19_of_20_rests_that_it_has_not_seen():
    inside = []
    for seed in range(100):
        rng = np.random.default_rng(seed)
        (found,) = calibrate(made(12, rng))
        new = made(20, rng)
        bounds = [told(found, float(current)) for current in new.currents[:, 0]]
        inside += [low <= t <= high for (low, high), t in zip(bounds, new.tensions[:, 0], strict=True)]
    assert np.mean(inside) > 0.95


def test_a_friction_whose_direction_is_unknown_is_in_the_scatter():
    rests = made(40, np.random.default_rng(1))
    (found,) = calibrate(replace(rests, directions=np.zeros_like(rests.directions)))
    assert found.gain == pytest.approx(GAIN, rel=0.1)
    assert found.friction > 1.5 * FRICTION


def test_tensions_that_are_all_alike_tell_no_gain():
    (found,) = calibrate(made(8, np.random.default_rng(2), span=(30.0, 31.0)))
    assert "30 to 31 N differ too little" in found.problem or "does not rise" in found.problem


def test_a_current_that_falls_with_tension_is_said():
    rests = made(12, np.random.default_rng(3))
    (found,) = calibrate(replace(rests, currents=-rests.currents))
    assert "does not rise with its tension" in found.problem


def windows_at_rest(robot, plan, gains):
    mechanism = Mechanism(robot)
    t = np.arange(50) / 100.0
    for planned in plan.windows:
        rest = pose_from_lengths(mechanism, robot.nominal, planned.lengths)
        current = rest.tensions_in_newton(robot.mass) / gains
        lengths = np.tile(planned.lengths, (50, 1))
        yield Window(planned.id, Role.IDENTIFY, t, np.zeros((50, 1, 3)), lengths, np.tile(current, (50, 1)))


def test_from_the_windows_of_a_robot():
    robot = read_robot(PAPERS_ROBOT)
    gains = np.array([30.0, 32.0, 34.0, 36.0])
    windows = tuple(windows_at_rest(robot, random_plan(robot, "poses", 6, 0, 1), gains))
    rests = rests_of(robot, robot.nominal, windows)
    assert [winch.gain for winch in calibrate(rests)] == pytest.approx(gains, rel=1e-6)
    assert np.all(rests.directions[0] == 0.0)
    assert set(np.unique(rests.directions[1:])) == {-1.0, 1.0}


def test_too_few_rests_are_refused():
    robot = read_robot(PAPERS_ROBOT)
    with pytest.raises(RefusedError, match="0 of 0 windows have lengths and currents; 5 rests are needed"):
        rests_of(robot, robot.nominal, ())


LOAD = 0.12


def made_with_gear(count, rng, noise=NOISE, load=LOAD):
    """Winches whose gear has another efficiency in each direction."""
    tension = rng.uniform(20.0, 120.0, (count, 1))
    direction = np.where(np.arange(count) % 2, 1.0, -1.0)[:, None]
    shown = tension * (1.0 - direction * load) - FRICTION * direction - OFFSET
    return Rests(tension, shown / GAIN + noise * rng.standard_normal((count, 1)), direction)


def test_friction_that_grows_with_the_load_is_found():
    (found,) = calibrate(made_with_gear(14, np.random.default_rng(5)))
    assert found.load_friction == pytest.approx(LOAD, abs=0.02)
    assert found.directed == pytest.approx(FRICTION, abs=1.0)
    assert found.scatter < 3.0 < found.friction


def test_with_the_direction_known_19_of_20_lie_in_a_narrow_band():
    inside, bands = [], []
    for seed in range(100):
        rng = np.random.default_rng(seed)
        (found,) = calibrate(made_with_gear(14, rng))
        new = made_with_gear(20, rng)
        bands.append((found.scatter, found.friction))
        for current, true, moved in zip(new.currents[:, 0], new.tensions[:, 0], new.directions[:, 0], strict=True):
            low, high = told(found, float(current), int(moved))
            inside.append(low <= true <= high)
    assert np.mean(inside) > 0.94
    scatter, friction = np.mean(bands, axis=0)
    assert scatter < friction / 4.0


def test_a_gear_alike_in_both_directions_gets_no_such_term():
    for seed in range(20):
        (found,) = calibrate(made(12, np.random.default_rng(seed)))
        assert abs(found.load_friction) < 0.2


def test_tension_checks_at_rest_are_narrower_than_means_of_swings():
    """Why a calibration from windows was too wide for use: the mean of a swing is not the tension of its rest."""
    robot = read_robot(PAPERS_ROBOT)
    plan = random_plan(robot, "rests", 8, 0, seed=4)
    mechanism = Mechanism(robot)
    rng = np.random.default_rng(1)
    readings = []
    for window in plan.windows:
        tension = pose_from_lengths(mechanism, robot.nominal, window.lengths).tensions_in_newton(robot.mass)
        currents = tension / GAIN + 0.02 * rng.standard_normal(robot.n)
        readings.append(TensionReading(window.lengths, currents, np.zeros(robot.n)))
    found = calibrate(rests_of_readings(robot, robot.nominal, readings))
    assert all(winch.friction < 4.0 and winch.gain == pytest.approx(GAIN, rel=0.03) for winch in found)
    by_cells = [replace(reading, load_cells=2.0 * GAIN * reading.currents) for reading in readings]
    assert calibrate(rests_of_readings(robot, robot.nominal, by_cells))[0].gain == pytest.approx(2.0 * GAIN)
    with pytest.raises(RefusedError, match="4 tension checks at rest; 5 are needed"):
        rests_of_readings(robot, robot.nominal, readings[:4])
