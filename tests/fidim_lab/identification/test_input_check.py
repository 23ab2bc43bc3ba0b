"""A place that is always the same, a wrong unit: seen without any fit."""

from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.data.records import Campaign, Robot, Role, Window
from fidim_lab.errors import RefusedError
from fidim_lab.identification.input_check import check


def window(name: str, *, place: float = 0.0, amplitude: float = 0.05, unit: float = 1.0) -> Window:
    t = np.arange(600) / 100
    rng = np.random.default_rng(len(name))
    swing = np.stack([np.sin(14 * t), np.sin(11 * t + 1), 0.2 * np.sin(25 * t)], axis=1)
    markers = np.array([1.2, -0.1, -0.3 - place]) + amplitude * swing + 1e-4 * rng.normal(size=(600, 3))
    return Window(name, Role.IDENTIFY, t, unit * markers[:, None], np.full((600, 4), 1.5 + place), None)


def campaign(robot: Robot, *windows: Window) -> Campaign:
    return Campaign("made up", robot, 100.0, windows)


def test_one_equilibrium_is_said(irma4):
    (note,) = check(campaign(irma4, window("i01"), window("i02"), window("i03")))
    assert "All 3 windows hang at one equilibrium (cable lengths within 0.0 mm, i01 to i03)" in note
    assert check(campaign(irma4, window("i01"), window("i02", place=0.1))) == ()


def test_wrong_units_and_stillness_are_refused_only_where_nothing_else_is_left(irma4):
    with pytest.raises(RefusedError, match=r"Windows i01, i02: the markers are in millimetres \(at 0.00 s of i01"):
        check(campaign(irma4, window("i01", unit=1e3), window("i02", unit=1e3)))
    (note,) = check(campaign(irma4, window("i01", unit=1e3), window("i02", place=0.1)))
    assert note.startswith("Window i01: the markers are in millimetres")
    with pytest.raises(RefusedError, match="No window moves: the largest motion is"):
        check(campaign(irma4, window("i01", amplitude=0.0), window("i02", place=0.1, amplitude=0.0)))
    (note,) = check(campaign(irma4, window("i01", amplitude=0.0), window("i02", place=0.1)))
    assert "Window i01: the markers do not move beyond their noise" in note


def test_a_marker_that_is_never_seen_is_said(irma4: Robot) -> None:
    """Others that are seen somewhere, or a phone's windows without any, are not."""
    two = replace(irma4, extra_markers=(np.array([0.1, 0.0, 0.0]),))
    windows = [
        replace(one, markers=np.concatenate([one.markers + by, one.markers], axis=1))
        for one, by in ((window("w1"), np.nan), (window("w02", place=0.2), np.nan))
    ]
    said = [note for note in check(campaign(two, *windows)) if "is seen in none" in note]
    assert said == ["Marker 1 is seen in none of 2 windows; the others show the motion."]
    windows[0] = replace(windows[0], markers=np.repeat(windows[0].markers[:, 1:], 2, axis=1))
    assert not [note for note in check(campaign(two, *windows)) if "is seen in none" in note]
