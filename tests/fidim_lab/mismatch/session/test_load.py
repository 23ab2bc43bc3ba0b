"""A change of the body is told as a load only where one at one place makes it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fidim_lab.data.records import Body
from fidim_lab.mismatch.session.load import changed, load_of

BODY = Body(com=np.array([0.002, -0.003, 0.17]), inertia=np.array([0.05, 0.06, 0.035, 1e-4, -2e-4, 3e-4]))
SD = np.array([1e-5] * 3 + [2e-6] * 6)
DRAWS = 300
PLACES = st.tuples(*[st.floats(0.05, 0.3), st.floats(-0.3, -0.05), st.floats(-0.3, 0.3)])


@given(share=st.one_of(st.floats(0.005, 0.2), st.floats(-0.1, -0.005)), place=PLACES)
def test_a_load_is_found_again(share: float, place: tuple[float, float, float]) -> None:
    at = np.array(place)
    found = load_of(BODY, changed(BODY, share, at), np.diag(SD**2))
    assert found is not None
    assert found.share == pytest.approx(share, abs=0.1 * found.share_sd + 1e-9)
    np.testing.assert_allclose(found.at, at, atol=float(0.1 * found.at_sd.max()) + 1e-9)


def test_two_loads_that_turn_the_body_alone_are_no_load_at_one_place() -> None:
    apart = changed(BODY, 0.02, np.array([0.2, 0.0, 0.1])) + changed(BODY, 0.02, np.array([-0.2, 0.0, 0.3]))
    assert load_of(BODY, apart, np.diag(SD**2)) is None


def test_where_mass_is_not_seen_no_place_is_told() -> None:
    vague = np.array([1e-5] * 3 + [1e-2] * 6)
    assert load_of(BODY, changed(BODY, 0.01, np.array([0.1, 0.0, 0.1])), np.diag(vague**2)) is None


def test_loads_are_told_as_often_as_noise_allows_and_two_never_as_one() -> None:
    """The numbers of docs/benchmarks/sensitivity.md, Loads."""
    rng = np.random.default_rng(1)
    told, two, within = 0, 0, []
    for _ in range(DRAWS):
        share = float(rng.choice([-1, 1]) * np.exp(rng.uniform(np.log(0.003), np.log(0.05))))
        at, other = rng.uniform((-0.2, -0.2, -0.1), (0.2, 0.2, 0.3)), rng.uniform(0.1, 0.3, 3)
        noise, half = SD * rng.standard_normal(9), changed(BODY, share / 2, at)
        found = load_of(BODY, changed(BODY, share, at) + noise, np.diag(SD**2))
        if found is not None:
            told += 1
            within += (np.abs(found.at - at) < 2 * found.at_sd).tolist()
        two += load_of(BODY, half + changed(BODY, share / 2, at + other) + noise, np.diag(SD**2)) is not None
    assert told > 0.96 * DRAWS
    assert 0.92 < np.mean(within) < 0.98
    assert two <= 0.01 * DRAWS
