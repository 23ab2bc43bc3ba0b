import numpy as np
import pytest

from fidim_lab.identification.excitation.again import may_gain, missed, why_again
from fidim_lab.identification.excitation.plan import Excitation

CLOSE = 0.15
WANTED = 0.030
"""m"""


def plan(reached: float, why: str = "") -> Excitation:
    return Excitation((), (), np.array([WANTED]), np.array([reached]), (30.0, 100.0), (0,), why)


CUT = plan(0.015, "50 % of the wanted swing: what tensions allow")


@pytest.mark.parametrize(
    ("seen", "by", "amiss"),
    [
        (0.031, plan(0.030), ""),
        (0.040, plan(0.030), "it swung 40.0 mm, 30.0 mm were planned"),
        (0.029, CUT, ""),  # as wanted, though less was planned
        (0.016, CUT, ""),  # as planned
        (0.022, CUT, "it swung 22.0 mm, 15.0 mm were planned"),
        (0.025, plan(0.029), ""),  # as planned, if a little less than wanted
    ],
)
def test_a_swing_is_amiss_where_it_is_neither_as_planned_nor_as_wanted(seen: float, by: Excitation, amiss: str):
    assert missed(np.array([seen]), by, CLOSE) == amiss


@pytest.mark.parametrize(("seen", "by", "may"), [(0.016, CUT, True), (0.029, CUT, False), (0.040, plan(0.030), True)])
def test_a_new_plan_is_made_where_it_is_amiss_or_less_than_wanted(seen: float, by: Excitation, may: bool):
    assert may_gain(np.array([seen]), by, CLOSE) is may


@pytest.mark.parametrize(
    ("seen", "by", "again", "why"),
    [
        # as planned, less than wanted: where all of it is in reach by now, or a third more
        (0.025, plan(0.029), plan(0.030), "as planned; with what it showed 30.0 mm can be reached"),
        (0.025, plan(0.029), plan(0.027, "90 %"), ""),
        (0.016, CUT, plan(0.025, "83 %"), "as planned; with what it showed 25.0 mm can be reached"),
        (0.016, CUT, plan(0.018, "60 %"), ""),
        # amiss: where it would be nearer to what is wanted
        (0.020, plan(0.030), plan(0.025, "83 %"), "20.0 mm, 30.0 mm were planned"),
        (0.045, plan(0.030), plan(0.020, "67 %"), "45.0 mm, 30.0 mm were planned"),
        (0.022, CUT, plan(0.018, "60 %"), ""),
        (0.040, plan(0.030), None, ""),  # nothing can be planned
        (0.029, CUT, plan(0.030), ""),  # it is as wanted
    ],
)
def test_a_window_is_done_again_where_that_gains(seen: float, by: Excitation, again: Excitation | None, why: str):
    found = why_again(np.array([seen]), by, again, CLOSE)
    assert bool(found) == bool(why)
    assert why in found
