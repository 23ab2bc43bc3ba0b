"""Intervals against scipy's own, the detection limit against a curve that is known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import special, stats

from benchmarks.sealed.statistics import Share, detection_limit


@given(st.integers(1, 400), st.data())
def test_interval_is_that_of_clopper_and_pearson(n, data):
    k = data.draw(st.integers(0, n))
    theirs = stats.binomtest(k, n).proportion_ci(0.95, method="exact")
    assert Share(k, n).interval == pytest.approx((theirs.low, theirs.high), abs=1e-9)


def test_no_alarm_on_a_hundred_nulls_still_leaves_three_and_a_half_per_cent():
    assert str(Share(0, 100)) == "0/100 = 0.0 % (0.0 – 3.6)"
    assert str(Share(0, 0)) == "–"


def test_limit_is_where_nine_in_ten_are_found():
    rng = np.random.default_rng(3)
    sizes = np.exp(rng.uniform(np.log(1e-3), np.log(1.0), 4000))
    found = rng.random(4000) < special.expit(2.5 * np.log(sizes / 0.02))
    limit = detection_limit(sizes, found)
    truth = 0.02 * np.exp(special.logit(0.9) / 2.5)
    assert limit is not None
    assert limit.size == pytest.approx(truth, rel=0.15)
    assert limit.low < truth < limit.high or limit.size == pytest.approx(truth, rel=0.05)
    assert not limit.beyond


def test_separated_outcomes_give_a_limit_between_them():
    sizes = np.geomspace(1.0, 1e4, 12)
    limit = detection_limit(sizes, sizes > 100)
    assert limit is not None
    assert 60 < limit.size < 1500


@pytest.mark.parametrize(("found", "beyond"), [(True, "below"), (False, "above")])
def test_limits_outside_of_what_was_tried_are_said_to_be_so(found, beyond):
    sizes = np.geomspace(1e-3, 1.0, 20)
    limit = detection_limit(sizes, np.full(20, found))
    assert limit is not None
    assert limit.beyond == beyond
    assert limit.size == pytest.approx(sizes.min() if found else sizes.max())


def test_three_sizes_are_too_few():
    assert detection_limit(np.array([1.0, 2.0, 3.0]), np.array([False, True, True])) is None
