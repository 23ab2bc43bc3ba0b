"""Columns of swivel encoders and inclinometer: found by name, and refused by name where they do not suffice."""

import numpy as np
import pytest

from fidim_lab.data.own_sensors import own_sensors
from fidim_lab.data.records import Role, Window
from fidim_lab.errors import SetupError


def window(cables: int, *names: str, lengths: bool = True) -> Window:
    t = np.arange(30) / 100
    further = {name: np.full(30, float(k)) for k, name in enumerate(names)}
    held = np.ones((30, cables)) if lengths else None
    return Window("i01", Role.IDENTIFY, t, np.full((30, 1, 3), np.nan), held, None, None, further)


def test_columns_are_found_in_the_order_of_cables_and_axes():
    found = own_sensors(window(3, "s2", "s1", "s3", "incl_y", "incl_x"), 3)
    assert found.swivels[0].tolist() == [1.0, 0.0, 2.0]
    assert found.inclination[0].tolist() == [4.0, 3.0]
    assert own_sensors(window(3, "s1", "s2", "s3"), 3).inclination.shape == (30, 0)


@pytest.mark.parametrize(
    ("cables", "names", "lengths", "says"),
    [
        (4, ("s1", "s2"), True, "Window i01 has no column s3, s4"),
        (4, ("s1", "s2", "s3", "s4"), False, "Window i01 has no cable lengths"),
        (4, ("s1", "s2", "s3", "s4", "incl_y"), True, "has incl_y alone"),
        (2, ("s1", "s2"), True, r"4 readings a sample \(2 lengths, 2 swivel angles, 0 inclinations\) leave the pose"),
    ],
)
def test_what_does_not_suffice_is_a_sentence(cables, names, lengths, says):
    with pytest.raises(SetupError, match=says):
        own_sensors(window(cables, *names, lengths=lengths), cables)
