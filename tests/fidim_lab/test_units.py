"""Numbers as people read them."""

import pytest

from fidim_lab.units import plain, signed


@pytest.mark.parametrize(
    ("value", "says"),
    [(2521.0, "2520"), (1.0, "1"), (0.0, "0"), (0.09932, "0.0993"), (1.2e-4, "0.00012"), (-123456.0, "-123000"),
     (9999.0, "10000"), (3.2e-7, "3.2e-07"), (4e12, "4e+12"), (float("inf"), "inf"), (float("nan"), "nan"),
     (11.98, "12")],
)  # fmt: skip
def test_a_number_has_three_figures_and_no_exponent_within_reach(value, says):
    assert plain(value) == says


def test_more_figures_where_they_are_asked_for():
    assert plain(123456.0, 5) == "123460"
    assert plain(0.0001234567, 5) == "0.00012346"


@pytest.mark.parametrize(
    ("value", "places", "says"),
    [(0.04, 1, "0.0"), (-0.04, 1, "0.0"), (0.06, 1, "+0.1"), (-12.34, 1, "-12.3"), (0.0, 4, "0.0000"), (3.0, 0, "+3")],
)
def test_nothing_has_no_sign(value, places, says):
    assert signed(value, places) == says
