import math
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from drivers.mocap.decoders import MarkerObjects, ViconUdpDecoder
from drivers.mocap.decoders.decoder import DecodedFrame, Malformed
from drivers.mocap.decoders.vicon_udp import SubjectPoints, ViconBlock, parse_block
from sim_backends.mocap.encoders import Occluded, ViconEncoder

# Written out byte by byte from the layout in the protocol's layout.
GOLDEN = bytes.fromhex(
    "04030201"  # frame 0x01020304
    "02"  # two items
    "00" "4800"  # object, 72 bytes
    "62616c6c00000000000000000000000000000000deadbeef"  # "ball", then NUL; what follows the NUL is nothing
    "0000000000408f40" "0000000000506fc0" "000000000000c03f"  # 1000, -250.5, 0.125 mm
    "0000000000000000" "000000000000e03f" "000000000000f0bf"  # 0, 0.5, -1 rad
    "00" "4800"
    "776e64000000000000000000000000000000000000000000"  # "wnd"
    "0000000000408fc0" "0000000000000000" "0000000000000000"  # -1000, 0, 0 mm
    "0000000000000000" "0000000000000000" "0000000000000000"
)  # fmt: skip


def test_golden_bytes() -> None:
    block = parse_block(GOLDEN.ljust(256, b"\0"))
    assert isinstance(block, ViconBlock)
    assert block.number == 0x01020304
    ball, wand = block.objects
    assert (ball.name, wand.name) == ("ball", "wnd")
    assert ball.translation == pytest.approx((1.0, -0.2505, 0.000125), abs=1e-15)
    assert ball.rotation == (0.0, 0.5, -1.0)
    assert wand.translation == (-1.0, 0.0, 0.0)


def test_markers_are_taken_by_name_in_the_order_asked_for() -> None:
    decoder = ViconUdpDecoder(MarkerObjects(("wnd", "ball", "gone")))
    (frame,) = decoder.receive(GOLDEN)
    assert isinstance(frame, DecodedFrame)
    assert frame.positions[0] == (-1.0, 0.0, 0.0)
    assert frame.positions[1] == pytest.approx((1.0, -0.2505, 0.000125))
    assert frame.positions[2] is None
    assert "'ball', 'wnd', not 'gone'" in decoder.advice()


def test_items_of_other_kinds_and_sizes_are_stepped_over() -> None:
    longer = b"\x00\x50\x00" + GOLDEN[8 : 5 + 75] + bytes(8)  # an object that grew by 8 bytes
    other = b"\x07\x05\x00abcde"
    block = parse_block(GOLDEN[:4] + b"\x03" + other + longer + GOLDEN[80:])
    assert isinstance(block, ViconBlock)
    assert [item.name for item in block.objects] == ["ball", "wnd"]


@pytest.mark.parametrize("length", range(len(GOLDEN)))
def test_a_datagram_cut_anywhere_is_malformed(length: int) -> None:
    (event,) = ViconUdpDecoder(MarkerObjects(("ball",))).receive(GOLDEN[:length])
    assert isinstance(event, Malformed)
    assert str(length) in event.problem


def test_an_object_too_short_for_a_pose_is_malformed() -> None:
    event = parse_block(GOLDEN[:4] + b"\x01\x00\x10\x00" + bytes(16))
    assert isinstance(event, Malformed)
    assert "16 bytes; an object has 72" in event.problem


@pytest.mark.parametrize(("millimetres", "expected"), [(math.nan, None), (math.inf, None), (0.0, None)])
def test_what_stands_for_an_occluded_object(millimetres: float, expected: None) -> None:
    packet = struct.pack("<IBBH24s6d", 1, 1, 0, 72, b"ball", millimetres, 0.0, 0.0, 0.0, 0.0, 0.0)
    assert ViconUdpDecoder(MarkerObjects(("ball",))).receive(packet) == [DecodedFrame(1, (expected,))]


def test_a_marker_beyond_a_kilometre_is_a_damaged_number() -> None:
    packet = struct.pack("<IBBH24s6d", 1, 1, 0, 72, b"ball", 1e7, 0.0, 0.0, 0.0, 0.0, 0.0)
    (event,) = ViconUdpDecoder(MarkerObjects(("ball",))).receive(packet)
    assert isinstance(event, Malformed)


@given(
    angles=st.tuples(*[st.floats(-math.pi, math.pi)] * 3),
    translation=st.tuples(*[st.floats(-5e3, 5e3)] * 3).filter(any),
    point=st.tuples(*[st.floats(-1.0, 1.0)] * 3),
)
def test_points_of_a_subject_follow_its_pose(
    angles: tuple[float, float, float],
    translation: tuple[float, float, float],
    point: tuple[float, float, float],
) -> None:
    packet = struct.pack("<IBBH24s6d", 1, 1, 0, 72, b"platform", *translation, *angles)
    (frame,) = ViconUdpDecoder(SubjectPoints("platform", (point, (0.0, 0.0, 0.0)))).receive(packet)
    assert isinstance(frame, DecodedFrame)
    origin = 1e-3 * np.array(translation)
    expected = origin + Rotation.from_euler("XYZ", angles).apply(point)
    assert np.allclose(np.array(frame.positions), [expected, origin], atol=1e-12)


COORDINATE = st.floats(-900.0, 900.0).map(lambda value: float(np.float32(value)))
MARKER = st.none() | st.tuples(COORDINATE, COORDINATE, COORDINATE).filter(any)


@given(number=st.integers(0, 2**32 - 1), markers=st.lists(MARKER, min_size=1, max_size=13))
def test_round_trip_with_the_independent_encoder(number: int, markers: list[tuple[float, float, float] | None]) -> None:
    names = [f"m{index}" for index in range(len(markers))]
    for occluded in (Occluded.ABSENT, Occluded.ZEROS):
        packet = ViconEncoder(names, occluded=occluded).encode(number, markers)
        assert len(packet) in (256, 512, 1024)
        (frame,) = ViconUdpDecoder(MarkerObjects(tuple(names))).receive(packet)
        assert isinstance(frame, DecodedFrame)
        assert frame.number == number
        for sent, got in zip(markers, frame.positions, strict=True):
            assert (sent is None and got is None) or got == pytest.approx(sent, rel=1e-12, abs=1e-12)


@given(data=st.binary(max_size=300))
def test_any_bytes_give_one_event_and_no_exception(data: bytes) -> None:
    decoder = ViconUdpDecoder(SubjectPoints("a", ((0.0, 0.0, 0.1),)))
    assert len(decoder.receive(data)) == 1


@given(at=st.integers(0, len(GOLDEN) - 1), byte=st.integers(0, 255))
def test_a_damaged_byte_gives_one_event_and_no_exception(at: int, byte: int) -> None:
    damaged = GOLDEN[:at] + bytes([byte]) + GOLDEN[at + 1 :]
    decoder = ViconUdpDecoder(SubjectPoints("ball", ((0.0, 0.0, 0.1),)))
    assert len(decoder.receive(damaged)) == 1


def test_names_of_damaged_packets_do_not_pile_up() -> None:
    decoder = ViconUdpDecoder(MarkerObjects(("ball",)))
    for index in range(500):
        decoder.receive(ViconEncoder([f"junk{index}"]).encode(index, [(1.0, 2.0, 3.0)]))
    decoder.receive(GOLDEN)
    assert decoder.advice().count("junk") == 0
    assert "not tracked" in decoder.advice()
