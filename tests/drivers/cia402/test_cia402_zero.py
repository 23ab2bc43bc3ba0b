"""Whether an encoder's zero of an earlier session still counts: what proves it, and what does not."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.cia402.bring_up.zero import StoredZero, zero_check
from drivers.cia402.profile.scale import wrap32

TOP = 2**31 - 1
CASES = {
    "multi-turn, same drive, anywhere": (StoredZero(7, True, 0, 10), 7, 123_456, True, ""),
    "multi-turn, another drive": (StoredZero(7, True, 0, 10), 8, 0, False, "drive 8: home it"),
    "multi-turn, no serial number": (StoredZero(0, True, 0, 10), 0, 0, False, "the zero cannot be assigned"),
    "incremental, where it was left": (StoredZero(7, False, 5_000, 10), 7, 5_010, True, "5010"),
    "incremental, power was off": (StoredZero(7, False, 5_000, 10), 7, 0, False, "its power was off"),
    "incremental, turned": (StoredZero(7, False, 5_000, 10), 7, 4_989, False, "or the drum was turned"),
    "incremental, never seen since": (StoredZero(7, False, None, 10), 7, 0, False, "none: home it"),
    "incremental, another drive": (StoredZero(7, False, 5_000, 10), 8, 5_000, False, "drive 8: home it"),
    "incremental, no serial number": (StoredZero(0, False, 5_000, 10), 0, 5_000, True, "5000"),
    "incremental, across the wrap": (StoredZero(7, False, TOP, 10), 7, -(2**31) + 3, True, ""),
}


@pytest.mark.parametrize("case", CASES)
def test_proof(case):
    zero, serial, count, ok, found = CASES[case]
    check = zero_check(zero, serial, count)
    assert check.ok is ok
    assert found in check.found


@given(st.integers(-(2**31), TOP), st.integers(0, 1000), st.integers(-3000, 3000))
def test_an_incremental_encoder_is_believed_within_its_tolerance_alone(last, tolerance, moved):
    check = zero_check(StoredZero(7, False, last, tolerance), 7, wrap32(last + moved))
    assert check.ok == (abs(moved) <= tolerance)
