"""The doctor holds lengths and markers against each other."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from drivers.ports import MarkerFrame
from fidim_lab.app.doctor.checks import CheckVerdict
from fidim_lab.app.doctor.mocap_doctor import Watched
from fidim_lab.app.doctor.rig_doctor import check_place, check_reach
from fidim_lab.data.rigs.rig_file import read_rig
from procedures.expected import NominalRest

RIG = read_rig(Path(__file__).parents[4] / "examples" / "rigs" / "simulated.toml")
LENGTHS = (1.34283, 1.43119, 1.56772, 1.45231)
MARKER = NominalRest(RIG.robot).at(LENGTHS).marker


def watched(place, swing=0.0):
    places = [np.add(place, (swing * np.sin(k / 10), 0.0, 0.0)) for k in range(200)]
    frames = tuple(MarkerFrame(k / 100, k, (tuple(map(float, one)),)) for k, one in enumerate(places))
    return Watched(frames, 2.0, {})


CASES = {
    "right": (LENGTHS, MARKER, CheckVerdict.OK, ""),
    "10 mm off, as surveys are": (LENGTHS, np.add(MARKER, (0.0, 0.0, 0.01)), CheckVerdict.OK, ""),
    "origin moved": (
        LENGTHS,
        np.add(MARKER, (0.3, 0.0, 0.0)),
        CheckVerdict.FAILED,
        "origin of motion capture, is off by (+300",
    ),
    "up is wrong": (LENGTHS, MARKER[[0, 2, 1]], CheckVerdict.FAILED, "y and z of the markers are exchanged"),
    "gear of all": (tuple(1.1 * one for one in LENGTHS), MARKER, CheckVerdict.FAILED, "all cables are"),
    "a slipped cable": ((1.34283, 1.39119, 1.56772, 1.45231), MARKER, CheckVerdict.FAILED, "cable 2 is 34 mm longer"),
    "no rest": ((1.34283, 9.43119, 1.56772, 1.45231), MARKER, CheckVerdict.FAILED, "zeros, gears and drums"),
    "not homed": (None, MARKER, CheckVerdict.WARNING, "correct"),
}


@pytest.mark.parametrize("case", CASES)
def test_where_the_lengths_put_the_marker(case):
    lengths, place, verdict, says = CASES[case]
    (check,) = check_place(RIG, lengths, watched(place))
    assert check.verdict is verdict, check.found
    assert says in check.advice
    assert "30 mm" in check.wanted


@pytest.mark.parametrize(("seen", "says"), [(None, "main marker"), (watched(MARKER, 0.04), "moves by 80 mm")])
def test_what_cannot_be_compared_is_said(seen, says):
    (check,) = check_place(RIG, LENGTHS, seen)
    assert check.verdict is CheckVerdict.WARNING
    assert says in check.found


@pytest.mark.parametrize(
    ("limits", "verdict"),
    [((0.2, 6.0), CheckVerdict.OK), ((0.2, 1.7), CheckVerdict.WARNING), ((200.0, 6000.0), CheckVerdict.FAILED)],
)
def test_length_limits_fit_the_lengths_with_which_the_robot_rests(limits, verdict):
    winches = tuple(entry.model_copy(update={"length_limits": limits}) for entry in RIG.winches)
    checks = check_reach(replace(RIG, winches=winches))
    assert [check.device for check in checks] == [entry.name for entry in RIG.winches]
    assert {check.verdict for check in checks} == {verdict}
