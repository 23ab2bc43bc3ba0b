import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from drivers.mocap.decoders import ViconUdpDecoder
from drivers.mocap.decoders.vicon_udp import SubjectPoints
from sim_backends.mocap.encoders import Occluded, TextEncoder, ViconEncoder, ViconSubjectEncoder

ROTATION = np.full(3, np.radians(0.1)).tobytes()
# Written out from the layout in the protocol's layout.
BALL = bytes.fromhex("00480062616c6c" + "00" * 20 + "0000000000408f400000000000506fc0000000000000c03f")
WAND = bytes.fromhex("004800776e64" + "00" * 21 + "0000000000408fc0" + "00" * 16)
BALL_AT, WAND_AT = (1.0, -0.2505, 0.000125), (-1.0, 0.0, 0.0)


def test_object_stream_golden_bytes() -> None:
    packet = ViconEncoder(["ball", "wnd"]).encode(0x01020304, [BALL_AT, WAND_AT])
    expected = bytes.fromhex("0403020102") + BALL + ROTATION + WAND + ROTATION
    assert packet == expected.ljust(256, b"\0")


@pytest.mark.parametrize(("objects", "size"), [(1, 256), (3, 256), (4, 512), (6, 512), (7, 1024), (13, 1024)])
def test_datagrams_are_padded_to_the_sizes_of_tracker(objects: int, size: int) -> None:
    assert len(ViconEncoder([str(i) for i in range(objects)]).encode(1, [BALL_AT] * objects)) == size


def test_what_is_sent_for_an_occluded_object() -> None:
    def second(occluded: Occluded) -> bytes:
        encoder = ViconEncoder(["ball", "wnd"], occluded=occluded)
        encoder.encode(1, [BALL_AT, WAND_AT])
        return encoder.encode(2, [None, WAND_AT])

    assert second(Occluded.ABSENT)[4:80] == b"\x01" + WAND + ROTATION
    assert second(Occluded.ZEROS)[4:80] == b"\x02" + BALL[:27] + bytes(48)
    assert second(Occluded.LAST_POSE)[4:80] == b"\x02" + BALL + ROTATION


def test_a_long_name_leaves_room_for_its_end() -> None:
    packet = ViconEncoder(["x" * 40]).encode(1, [BALL_AT])
    assert packet[8:32] == b"x" * 23 + b"\0"


def test_the_counter_wraps() -> None:
    assert ViconEncoder(["a"]).encode(2**32 + 5, [BALL_AT])[:4] == b"\x05\0\0\0"


@pytest.mark.parametrize(
    ("positions", "line"),
    [
        ([(1.0, -2.5, 0.003)], b"7,1.000,-2.500,0.003\n"),
        ([None, (1.0, -2.5, 0.003)], b"7,,,,1.000,-2.500,0.003\n"),
    ],
)
def test_lines(positions: list[tuple[float, float, float] | None], line: bytes) -> None:
    assert TextEncoder(checksum=False, digits=3).encode(7, positions) == line
    total = np.bitwise_xor.reduce(np.frombuffer(line[:-1], np.uint8))
    assert TextEncoder(digits=3).encode(7, positions) == line[:-1] + b"*%02X\n" % total


POINTS = ((0.0, 0.0, -0.1), (0.25, 0.0, -0.1), (0.0, 0.25, -0.1))


def test_a_tracked_body_carries_its_points_to_where_they_are() -> None:
    turn = Rotation.from_euler("XYZ", [0.3, -0.2, 2.5])
    where = turn.apply(POINTS) + np.array([1.1, -0.3, -0.4])
    packet = ViconSubjectEncoder("platform", POINTS).encode(7, [tuple(map(float, row)) for row in where])
    (event,) = ViconUdpDecoder(SubjectPoints("platform", POINTS)).receive(packet)
    np.testing.assert_allclose(event.positions, where, atol=1e-12)


def test_a_body_of_which_two_points_are_seen_is_not_tracked() -> None:
    packet = ViconSubjectEncoder("platform", POINTS).encode(7, [POINTS[0], None, POINTS[2]])
    (event,) = ViconUdpDecoder(SubjectPoints("platform", POINTS)).receive(packet)
    assert event.positions == (None, None, None)
