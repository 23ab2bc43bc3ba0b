import math
import struct
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.cia402.wire.pdo import (
    RPDO,
    TPDOS,
    DriveValues,
    Mappable,
    ObjectValue,
    PdoMap,
    SampleDecoder,
    VendorEntry,
    mapping_expected,
    mapping_writes,
)
from fidim_lab.errors import OurBugError

FIRST = bytes.fromhex("37 06 FE FF FF FF 01")
SECOND = bytes.fromhex("18 FC FF FF 64 00")


def test_the_layout_on_the_wire() -> None:
    decoder = SampleDecoder()
    assert decoder.feed(0, FIRST, 1.0) is None
    assert decoder.feed(1, SECOND, 1.0) == DriveValues(1.0, 0x0637, -2, 1, -1000, 100)
    assert (decoder.received, decoder.incomplete, decoder.doubled, decoder.malformed) == (1, 0, 0, 0)


def test_mapping_in_the_order_of_the_standard() -> None:
    assert mapping_writes(TPDOS[0], 3) == (
        ObjectValue(0x1800, 1, 0xC0000183),
        ObjectValue(0x1A00, 0, 0),
        ObjectValue(0x1A00, 1, 0x60410010),
        ObjectValue(0x1A00, 2, 0x60640020),
        ObjectValue(0x1A00, 3, 0x60610008),
        ObjectValue(0x1A00, 0, 3),
        ObjectValue(0x1800, 2, 1),
        ObjectValue(0x1800, 1, 0x40000183),
    )
    assert mapping_writes(RPDO, 3)[0] == ObjectValue(0x1400, 1, 0x80000203)
    assert mapping_writes(RPDO, 3)[-1] == ObjectValue(0x1400, 1, 0x203)
    assert RPDO.format.size == 7


def test_a_missing_tpdo_gives_no_sample_and_is_counted() -> None:
    decoder = SampleDecoder()
    decoder.feed(0, FIRST, 1.0)
    decoder.feed(0, FIRST, 2.0)
    assert decoder.incomplete == 1
    assert decoder.feed(1, SECOND, 2.0) is not None


def test_values_of_two_syncs_are_never_mixed() -> None:
    decoder = SampleDecoder()
    decoder.feed(0, FIRST, 1.0)
    assert decoder.feed(1, SECOND, 2.0) is None


def test_a_late_tpdo_is_replaced_by_the_right_one() -> None:
    decoder = SampleDecoder()
    late = struct.pack("<Hib", 0x0637, 111, 1)
    right = struct.pack("<Hib", 0x0637, 222, 1)
    decoder.feed(0, late, 2.0)
    decoder.feed(0, right, 2.0)
    values = decoder.feed(1, SECOND, 2.0)
    assert values is not None
    assert values.position == 222
    assert decoder.doubled == 1


@pytest.mark.parametrize("data", [b"", FIRST[:-1], FIRST + b"\0"])
def test_a_wrong_length_is_counted_and_dropped(data: bytes) -> None:
    decoder = SampleDecoder()
    assert decoder.feed(0, data, 1.0) is None
    assert decoder.malformed == 1
    assert decoder.feed(1, SECOND, 1.0) is None


@given(
    st.integers(0, 0xFFFF),
    st.integers(-(2**31), 2**31 - 1),
    st.integers(-128, 127),
    st.integers(-(2**31), 2**31 - 1),
    st.integers(-(2**15), 2**15 - 1),
    st.booleans(),
)
def test_what_a_drive_packs_is_what_we_read(status: int, position: int, mode: int, v: int, i: int, swap: bool) -> None:
    frames = [(0, struct.pack("<Hib", status, position, mode)), (1, struct.pack("<ih", v, i))]
    decoder = SampleDecoder()
    values = [decoder.feed(part, data, 5.0) for part, data in (reversed(frames) if swap else frames)]
    assert values == [None, DriveValues(5.0, status, position, mode, v, i)]


@given(st.lists(st.tuples(st.integers(0, 1), st.binary(max_size=8), st.integers(0, 3)), max_size=40))
def test_any_frames_in_any_order(frames: list[tuple[int, bytes, int]]) -> None:
    decoder = SampleDecoder()
    for part, data, t in frames:
        decoder.feed(part, data, float(t))
    assert decoder.malformed == sum(len(data) != (7, 6)[part] for part, data, _ in frames)


def test_a_layout_that_leaves_a_value_out_is_our_bug() -> None:
    with pytest.raises(OurBugError, match="POSITION"):
        SampleDecoder((PdoMap(1, transmit=True, entries=(Mappable.STATUSWORD,), transmission=1),))


def test_without_a_velocity_it_is_the_change_of_the_position_over_the_wrap_as_well() -> None:
    one = PdoMap(1, transmit=True, entries=(Mappable.STATUSWORD, Mappable.POSITION, Mappable.CURRENT), transmission=1)
    decoder = SampleDecoder((one,), velocity_digit=2.0)
    places = [(1.0, 2**31 - 10), (1.5, -(2**31) + 90), (2.0, -(2**31) - 10 + 2**32)]
    told = [decoder.feed(0, one.format.pack(0x27, place, 100), t) for t, place in places]
    assert [values and values.velocity for values in told] == [0.0, 100.0, -100.0]
    assert [values and values.current for values in told] == [100, 100, 100]


def test_what_nobody_asked_for_in_a_fixed_pdo_is_passed_over() -> None:
    other = VendorEntry("", 0x60FD, 0, "4s")
    told = PdoMap(1, transmit=True, entries=(other, Mappable.STATUSWORD), transmission=1, mapping_fixed=True)
    place = PdoMap(2, transmit=True, entries=(Mappable.VELOCITY, Mappable.POSITION), transmission=1)
    decoder = SampleDecoder((told, place))
    assert decoder.feed(0, bytes.fromhex("01 02 03 04 37 06"), 1.0) is None
    values = decoder.feed(1, bytes.fromhex("18 FC FF FF FE FF FF FF"), 1.0)
    assert values is not None
    assert (values.statusword, values.position, values.velocity) == (0x0637, -2, -1000)
    assert math.isnan(values.current)


def test_what_is_fixed_is_not_written() -> None:
    fixed = replace(TPDOS[0], mapping_fixed=True)
    assert mapping_writes(fixed, 3) == (
        ObjectValue(0x1800, 1, 0xC0000183),
        ObjectValue(0x1800, 2, 1),
        ObjectValue(0x1800, 1, 0x40000183),
    )
    assert mapping_writes(replace(fixed, cob_fixed=True, type_fixed=True), 3) == ()
    assert [o.value for o in mapping_expected(fixed, 3)][:2] == [3, 0x60410010], "it is compared all the same"
