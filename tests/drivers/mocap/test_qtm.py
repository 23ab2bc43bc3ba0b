"""Qualisys: packets cut anywhere, damaged, renamed; a session asked as a client asks."""

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.mocap.decoders import QtmDecoder
from drivers.mocap.decoders.decoder import DecodedFrame, Malformed
from drivers.mocap.decoders.qtm import NAMES, REQUESTS, QtmRequests, command
from sim_backends.mocap.qtm import QtmEncoder, QtmSession

XML = b"<QTM_Parameters_Ver_1.19><The_3D><Label><Name>a</Name></Label><Label>\n <Name>b</Name></Label></The_3D>\0"


def packet(kind, body):
    return struct.pack("<II", 8 + len(body), kind) + body


def data(number, *points, time=0, strays=()):
    """points, strays: labelled markers and those without a label, mm."""
    component = struct.pack("<IIIHH", 16 + 12 * len(points), 1, len(points), 0, 0)
    component += b"".join(struct.pack("<3f", *point) for point in points)
    component += struct.pack("<IIIHH", 16 + 16 * len(strays), 2, len(strays), 0, 0)
    component += b"".join(struct.pack("<3fI", *point, 7) for point in strays)
    return packet(3, struct.pack("<qii", time, number, 2) + component)


def names(*labels):
    named = "".join(f"<Label><Name>{label}</Name></Label>" for label in labels)
    return packet(2, f"<QTM_Parameters_Ver_1.19><The_3D>{named}</The_3D>\0".encode())


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
    assert decoder.receive(names("a") + packet(3, body)) == [DecodedFrame(3, ((1.0, 0.0, 0.0),))]


def test_a_name_that_is_not_there_is_said():
    decoder = QtmDecoder(("main",))
    assert decoder.receive(packet(2, XML) + data(1, (0, 0, 0), (0, 0, 0))) == [DecodedFrame(1, (None,))]
    assert "QTM has a, b, not main" in decoder.advice()


WRONG = {
    "error": (packet(0, b"Parse error\0"), "QTM answers: Parse error"),
    "length": (b"HTTP/1.1 400", "is this its port"),
    "short": (packet(3, b"\0" * 16)[:-4] + b"\1\0\0\0", "ends too early"),
    "far": (names("a") + data(1, (1e7, 0, 0)), "more than a kilometre"),
    "two of one name": (names("a", "a") + data(1, (1, 0, 0), (2, 0, 0)), "in two places"),
    "too few": (names("a") + data(1, (1, 0, 0))[:-40] + bytes(40), "ends too early"),
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
    stream = names("a") + b"".join(data(n, (1000.0 * n, 0.0, 0.0)) for n in range(1, 5))
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


def test_labels_that_change_are_never_taken_for_the_old_ones():
    """By the number of markers, by an event, and by neither: then within a second."""
    decoder = QtmDecoder(("main",))
    here, there = (1000.0, 0.0, 0.0), (9000.0, 0.0, 0.0)
    known = DecodedFrame(1, ((1.0, 0.0, 0.0),))
    assert decoder.receive(names("main", "aux") + data(1, here, there)) == [known]
    assert decoder.receive(data(2, there, here, there)) == [DecodedFrame(2, (None,))]
    assert decoder.receive(names("new", "main", "aux") + data(1, there, here, there)) == [known]
    assert decoder.receive(packet(6, b"\x0b") + data(2, there, here, there)) == [DecodedFrame(2, (None,))]
    assert decoder.receive(names("main", "new", "aux") + data(1, here, there, there)) == [known]


def test_names_are_asked_for_again_whenever_they_may_be_others():
    session, client = QtmSession(["a", "b"]), QtmRequests()
    client.receive(session.greeting())
    assert client.receive(session.receive(REQUESTS) + data(1, NAN, NAN)) == b""
    assert client.receive(data(2, NAN, NAN, time=999_999)) == b""
    assert client.receive(data(3, NAN, NAN, time=1_000_000)) == NAMES  # a second is over
    assert client.receive(data(4, NAN, NAN, time=1_900_000)) == b""
    assert client.receive(data(5, NAN, NAN, NAN, time=1_910_000)) == NAMES  # three markers instead of two
    assert client.receive(session.relabelled(["b", "a"], event=8)) == NAMES
    assert b"<Name>b</Name>" in session.receive(NAMES).partition(b"<Name>a</Name>")[0]


def test_labels_as_xml_writes_them():
    session, decoder = QtmSession(['Kopf "ä" & <Co>']), QtmDecoder(('Kopf "ä" & <Co>',))
    (event,) = decoder.receive(session.receive(REQUESTS) + data(1, (1000.0, 2000.0, 3000.0)))
    assert event.positions == ((1.0, 2.0, 3.0),)
    other = packet(2, b"<The_3D><Label><RGBColor>1</RGBColor><Name>a&#228;&apos;</Name></Label></The_3D>")
    assert QtmDecoder(("a\u00e4'",)).receive(other + data(2, (1000.0, 0.0, 0.0))) == [DecodedFrame(2, ((1.0, 0, 0),))]


def test_the_only_marker_without_a_label():
    decoder = QtmDecoder(("unlabelled",))
    one, two = (1000.0, 0.0, 0.0), (2000.0, 0.0, 0.0)
    assert decoder.receive(names() + data(1, strays=[one])) == [DecodedFrame(1, ((1.0, 0.0, 0.0),))]
    assert decoder.receive(data(2, strays=[one, two])) == [DecodedFrame(2, (None,))]
    assert "Markers without a label: 2" in decoder.advice()
