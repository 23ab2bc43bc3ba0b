import string
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.mocap.decoders import MarkerTextDecoder
from drivers.mocap.decoders.decoder import DecodedFrame, Malformed
from drivers.mocap.decoders.marker_text import LONGEST_LINE
from sim_backends.mocap.encoders import TextEncoder

HERE = (1.0, -2.5, 0.003)


@pytest.mark.parametrize(
    ("line", "number", "positions"),
    [
        (b"7,1,-2.5,0.003\n", 7, (HERE, None)),
        (b"7,1.0,-2.5e0,3E-3,,,\n", 7, (HERE, None)),
        (b" 7 , 1 ,-2.5 , +0.003, , ,\t\r\n", 7, (HERE, None)),
        (b"FRAME 7,1,-2.5,0.003,nan,NaN,nan\n", 7, (HERE, None)),
        (b"frame,7,,,,1,-2.5,0.003\n", 7, (None, HERE)),
        (b"7,1,-2.5,0.003,,,*2F\n", 7, (HERE, None)),
        (b"7,1,-2.5,0.003,,,*2f\n", 7, (HERE, None)),
    ],
)
def test_lines_that_are_frames(line: bytes, number: int, positions: tuple[object, ...]) -> None:
    one_marker = line == b"7,1,-2.5,0.003\n"
    (event,) = MarkerTextDecoder(1 if one_marker else 2).receive(line)
    assert event == DecodedFrame(number, positions[:1] if one_marker else positions)


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        (b"7,1,2\n", "has 3 fields, not 4"),
        (b"7,1,2,3,4,5,6\n", "has 7 fields, not 4"),
        (b",1,2,3\n", "frame counter"),
        (b"-7,1,2,3\n", "frame counter"),
        (b"7.0,1,2,3\n", "frame counter"),
        (b"123456789012345678901,1,2,3\n", "frame counter of more than"),
        (b"99999999999999999999,1,2,3\n", "frame counter of more than 9223372036854775807"),
        (b"9223372036854775808,1,2,3\n", "frame counter of more than"),
        (b"7,1,,3\n", "three numbers or three blanks"),
        (b"7,1,2,3-4\n", "three numbers or three blanks"),
        (b"7,1_0,2,3\n", "not part of a number"),
        (b"7,1,2,inf\n", "not part of a number"),
        (b"7,1,2,1e999\n", "not within a kilometre"),
        (b"7,1,2,1001\n", "not within a kilometre"),
        (b"7,1,2,3*00\n", "checksum is not"),
        (b"7,1,2,3*\n", "checksum is not"),
        (b"7,1,2,3*zz\n", "checksum is not"),
        (b"\xff\xfe\x00garbage\n", "\\xff\\xfe"),
    ],
)
def test_lines_that_are_not(line: bytes, problem: str) -> None:
    (event,) = MarkerTextDecoder(1).receive(line)
    assert isinstance(event, Malformed)
    assert problem in event.problem


def test_comments_and_empty_lines_are_nothing() -> None:
    assert MarkerTextDecoder(1).receive(b"\n# marker server 1.0\r\n   \n") == []


def test_a_required_checksum_is_missed() -> None:
    (event,) = MarkerTextDecoder(1, checksum_required=True).receive(b"7,1,2,3\n")
    assert isinstance(event, Malformed)
    assert "no checksum" in event.problem


TRANSCRIPT = b"41,1.25,2.5,3.75\n42,,,\n"
FRAMES = [DecodedFrame(41, ((1.25, 2.5, 3.75),)), DecodedFrame(42, (None,))]


@pytest.mark.parametrize("cut", range(len(TRANSCRIPT) + 1))
def test_lines_torn_anywhere_are_put_together(cut: int) -> None:
    decoder = MarkerTextDecoder(1)
    assert decoder.receive(TRANSCRIPT[:cut]) + decoder.receive(TRANSCRIPT[cut:]) == FRAMES


def test_byte_by_byte() -> None:
    decoder = MarkerTextDecoder(1)
    assert [event for byte in TRANSCRIPT for event in decoder.receive(bytes([byte]))] == FRAMES


def test_a_new_connection_forgets_the_torn_line() -> None:
    decoder = MarkerTextDecoder(1)
    decoder.receive(b"40,9,9")
    decoder.restart()
    assert decoder.receive(TRANSCRIPT) == FRAMES


def test_a_line_without_end_is_reported_once_and_left_at_the_next_newline() -> None:
    decoder = MarkerTextDecoder(1)
    events = [event for _ in range(50) for event in decoder.receive(b"1" * (LONGEST_LINE // 8))]
    assert len(events) == 1
    assert decoder.receive(b"11\n" + TRANSCRIPT) == FRAMES


COORDINATE = st.floats(-999.0, 999.0).map(lambda value: round(value, 7) + 0.0)
MARKER = st.none() | st.tuples(COORDINATE, COORDINATE, COORDINATE).filter(any)
STREAM = st.lists(st.tuples(st.integers(0, 10**12), st.tuples(MARKER, MARKER)), max_size=8)


@given(stream=STREAM, cuts=st.lists(st.integers(0, 600), max_size=6), checksum=st.booleans())
def test_round_trip_in_any_pieces(
    stream: list[tuple[int, tuple[tuple[float, float, float] | None, ...]]], cuts: list[int], checksum: bool
) -> None:
    encoder = TextEncoder(checksum=checksum)
    data = b"".join(encoder.encode(number, markers) for number, markers in stream)
    edges = [0, *sorted(min(cut, len(data)) for cut in cuts), len(data)]
    decoder = MarkerTextDecoder(2, checksum_required=checksum)
    events = [event for a, b in pairwise(edges) for event in decoder.receive(data[a:b])]
    assert events == [DecodedFrame(number, markers) for number, markers in stream]


@given(pieces=st.lists(st.binary(max_size=60), max_size=12))
def test_any_bytes_never_raise(pieces: list[bytes]) -> None:
    decoder = MarkerTextDecoder(1)
    lines = b"".join(pieces).count(b"\n")
    assert sum(len(decoder.receive(piece)) for piece in pieces) <= lines


@given(text=st.text(string.digits + ",.-+eEnaNFRM*# \r\n", max_size=200))
def test_what_looks_like_lines_never_raises(text: str) -> None:
    decoder = MarkerTextDecoder(1)
    for event in decoder.receive(text.encode()):
        assert isinstance(event, DecodedFrame | Malformed)


@given(at=st.integers(0, 30), flip=st.integers(1, 255))
def test_the_checksum_finds_every_damaged_byte(at: int, flip: int) -> None:
    line = bytearray(TextEncoder().encode(1042, [(1.25, 2.5, 3.75)]))
    line[at % (len(line) - 4)] ^= flip
    # A byte that became a newline, a star or the line's first "#" makes other lines, but never this frame.
    events = MarkerTextDecoder(1, checksum_required=True).receive(bytes(line))
    assert not any(isinstance(event, DecodedFrame) for event in events)
