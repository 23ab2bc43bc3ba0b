"""Qualisys: packets cut anywhere, damaged, renamed; a session asked as a client asks."""

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.mocap.decoder import DecodedFrame, Malformed
from drivers.mocap.qtm import REQUESTS, QtmDecoder, QtmRequests, command
from sim_backends.mocap.qtm import QtmEncoder, QtmSession

XML = b"<QTM_Parameters_Ver_1.19><The_3D><Label><Name>a</Name></Label><Label>\n <Name>b</Name></Label></The_3D>\0"


def packet(kind, body):
    return struct.pack("<II", 8 + len(body), kind) + body


def data(number, *points):
    component = struct.pack("<IIIHH", 16 + 12 * len(points), 1, len(points), 0, 0)
    body = struct.pack("<qii", 0, number, 1) + component + b"".join(struct.pack("<3f", *point) for point in points)
    return packet(3, body)


NAN = (float("nan"),) * 3


def test_markers_by_name_in_metres():
    decoder = QtmDecoder(("b", "a"))
    events = decoder.receive(packet(2, XML) + data(7, (1000.0, 0.0, -500.0), (1.0, 2.0, 3.0)) + data(8, NAN, NAN))
    assert events[0].number == 7
    assert events[0].positions[0] == pytest.approx((0.001, 0.002, 0.003))
    assert events[0].positions[1] == (1.0, 0.0, -0.5)
    assert events[1] == DecodedFrame(8, (None, None))


def test_another_component_before_the_markers_is_passed_over():
    other = struct.pack("<II", 12, 5) + b"abcd"
    whole = data(3, (1000.0, 0.0, 0.0))
    body = whole[8:20] + struct.pack("<i", 2) + other + whole[24:]
    decoder = QtmDecoder(("a",))
    assert decoder.receive(packet(2, XML) + packet(3, body)) == [DecodedFrame(3, ((1.0, 0.0, 0.0),))]


def test_a_name_that_is_not_there_is_said():
    decoder = QtmDecoder(("main",))
    assert decoder.receive(packet(2, XML) + data(1, (0, 0, 0), (0, 0, 0))) == [DecodedFrame(1, (None,))]
    assert "QTM has a, b, not main" in decoder.advice()


WRONG = {
    "error": (packet(0, b"Parse error\0"), "QTM answers: Parse error"),
    "length": (b"HTTP/1.1 400", "is this its port"),
    "short": (packet(3, b"\0" * 16)[:-4] + b"\1\0\0\0", "ends too early"),
    "far": (packet(2, XML) + data(1, (1e7, 0, 0)), "more than a kilometre"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_no_frame_is_said(case):
    sent, says = WRONG[case]
    (event,) = QtmDecoder(("a",)).receive(sent)
    assert isinstance(event, Malformed)
    assert says in event.problem


def test_a_client_asks_once_and_is_answered():
    session, client = QtmSession(["a", "b"]), QtmRequests()
    frame = QtmEncoder().encode(5, [(1.0, 2.0, 3.0), None])
    assert session.pass_on(frame) == b""
    assert client.receive(session.greeting()) == REQUESTS
    assert client.receive(b"more") == b""
    decoder = QtmDecoder(("a", "b"))
    answers = session.receive(REQUESTS[:13]) + session.receive(REQUESTS[13:])
    assert b"Version set to 1.19" in answers
    assert decoder.receive(answers + session.pass_on(frame)) == [DecodedFrame(5, ((1.0, 2.0, 3.0), None))]
    assert b"Parse error" in session.receive(command("Sing"))
    session.receive(command("StreamFrames Stop"))
    assert session.pass_on(frame) == b""


@given(st.lists(st.integers(1, 200), max_size=20))
def test_pieces_cut_anywhere_are_put_together(cuts):
    stream = packet(2, XML) + b"".join(data(n, (1000.0 * n, 0.0, 0.0)) for n in range(1, 5))
    decoder, events = QtmDecoder(("a",)), []
    for cut in [*cuts, len(stream)]:
        events += decoder.receive(stream[:cut])
        stream = stream[cut:]
    assert [event.positions[0][0] for event in events] == [1.0, 2.0, 3.0, 4.0]


@given(st.lists(st.one_of(st.binary(max_size=60), st.binary(max_size=60).map(lambda b: packet(3, b)))))
def test_no_bytes_raise(pieces):
    decoder = QtmDecoder(("a",))
    for piece in pieces:
        assert all(isinstance(event, DecodedFrame | Malformed) for event in decoder.receive(piece))
