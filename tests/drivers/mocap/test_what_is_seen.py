"""What counts as seen: one rule for every format, and a marker that two have the name of."""

import math

import pytest

from drivers.mocap.decoders import MarkerObjects, MarkerTextDecoder, OscDecoder, ViconDataStreamDecoder, ViconUdpDecoder
from drivers.mocap.decoders.decoder import DecodedFrame, Malformed, frame_of, is_place
from sim_backends.mocap.datastream import DataStreamEncoder
from sim_backends.mocap.encoders import OscEncoder, ViconEncoder

HERE, THERE = (1.0, 2.0, 3.0), (4.0, 5.0, 6.0)
ORIGIN = (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("position", "seen"),
    [(HERE, True), (ORIGIN, False), ((0.0, 0.0, 1e-9), True), ((math.nan, 0.0, 0.0), False), ((math.inf, 0, 0), True)],
)
def test_a_place(position, seen):
    assert is_place(position) is seen


def test_markers_by_key():
    seen = [("a", HERE), ("b", THERE), ("a", HERE), ("c", ORIGIN), ("c", THERE)]
    assert frame_of(1, ("a", "c", "x"), ("a", "c", None), seen) == DecodedFrame(1, (HERE, THERE, None))
    twice = [("a", HERE), ("a", THERE), ("b", HERE)]
    assert frame_of(1, ("b",), ("b",), twice) == DecodedFrame(1, (HERE,))
    assert isinstance(frame_of(1, ("a",), ("a",), twice), Malformed)
    assert frame_of(1, ("one",), ("a",), twice, alone="a") == DecodedFrame(1, (None,))
    assert frame_of(1, ("one",), ("b",), twice, alone="b") == DecodedFrame(1, (HERE,))
    assert isinstance(frame_of(1, ("a",), ("a",), [("a", (1e4, 0.0, 0.0))]), Malformed)


STREAMS = {
    "osc": (OscDecoder(("/m",)), OscEncoder(("/m",))),
    "vicon-udp": (ViconUdpDecoder(MarkerObjects(("m",))), ViconEncoder(("m",))),
    "vicon-datastream": (ViconDataStreamDecoder(("m",)), DataStreamEncoder(("m",))),
}


@pytest.mark.parametrize("kind", STREAMS)
def test_the_origin_to_the_last_bit_is_a_marker_that_is_not_seen(kind):
    decoder, encoder = STREAMS[kind]
    assert decoder.receive(encoder.encode(1, [ORIGIN])) == [DecodedFrame(1, (None,))]
    assert decoder.receive(encoder.encode(2, [(0.0, 0.0, 1.0)])) == [DecodedFrame(2, ((0.0, 0.0, 1.0),))]


def test_lines_of_text_too():
    frames = MarkerTextDecoder(1).receive(b"1,0,0,0\n2,0.0,-0,0.000\n3,nan,1,2\n4,0,0,0.001\n")
    assert [frame.positions[0] for frame in frames] == [None, None, None, (0.0, 0.0, 0.001)]


def test_an_object_twice_in_a_block_is_damage_where_the_two_differ():
    decoder = ViconUdpDecoder(MarkerObjects(("m",)))
    (event,) = decoder.receive(ViconEncoder(("m", "m")).encode(1, [HERE, THERE]))
    assert isinstance(event, Malformed)
    assert "'m' occurs twice" in event.problem
    assert decoder.receive(ViconEncoder(("m", "m")).encode(2, [HERE, HERE])) == [DecodedFrame(2, (HERE,))]


@pytest.mark.parametrize(("strays", "place"), [([HERE], HERE), ([HERE, THERE], None), ([], None)])
def test_the_only_marker_of_the_datastream_that_belongs_to_no_subject(strays, place):
    decoder = ViconDataStreamDecoder(("unlabelled",))
    assert decoder.receive(DataStreamEncoder(("m",), strays=strays).encode(1, [THERE])) == [DecodedFrame(1, (place,))]
