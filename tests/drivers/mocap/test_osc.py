"""OSC: our reader and our simulated sender, each against python-osc, which neither knows; damaged datagrams."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pythonosc.osc_bundle import OscBundle
from pythonosc.osc_bundle_builder import IMMEDIATELY, OscBundleBuilder
from pythonosc.osc_message_builder import OscMessageBuilder

from drivers.mocap.decoders import OscDecoder, address_of
from drivers.mocap.decoders.decoder import DecodedFrame, Malformed
from drivers.mocap.decoders.osc import parse_osc
from sim_backends.mocap.encoders import OscEncoder

ADDRESSES = ("/marker/main", "/marker/second")


def message(address, *arguments):
    builder = OscMessageBuilder(address)
    for argument in arguments:
        builder.add_arg(argument)
    return builder.build()


def bundle(*contents):
    builder = OscBundleBuilder(IMMEDIATELY)
    for content in contents:
        builder.add_content(content)
    return builder.build()


def test_a_bundle_of_python_osc_is_a_frame():
    inner = bundle(message("/marker/second", 1.5, -2.0, 0.25, "quality", True, b"blob"))
    data = bundle(message("/frame", 42), inner, message("/marker/main", 1.0, 2, 3.0)).dgram
    assert OscDecoder(ADDRESSES).receive(data) == [DecodedFrame(42, ((1.0, 2.0, 3.0), (1.5, -2.0, 0.25)))]


def test_python_osc_reads_what_the_simulated_sender_sends():
    data = OscEncoder(ADDRESSES).encode(7, [(1.25, -0.5, 0.75), None])
    read = OscBundle(data)
    assert [(item.address, item.params) for item in read] == [("/frame", [7]), ("/marker/main", [1.25, -0.5, 0.75])]
    assert OscDecoder(ADDRESSES).receive(data) == [DecodedFrame(7, ((1.25, -0.5, 0.75), None))]


def test_unit_and_addresses_are_the_rig_files():
    data = bundle(message("/vicon/frame", 3, 100.0), message("/a/b", 1000.0, 0.0, -500.0)).dgram
    decoder = OscDecoder((address_of("/a/b"), address_of("c")), frame_address="/vicon/frame", unit=1e-3)
    assert decoder.receive(data) == [DecodedFrame(3, ((1.0, 0.0, -0.5), None))]
    assert decoder.addresses[1] == "/marker/c"
    assert "/vicon/frame" in decoder.advice()


def test_nan_is_an_occluded_marker():
    data = bundle(message("/frame", 3), message("/marker/main", math.nan, 0.0, 0.0)).dgram
    assert OscDecoder(ADDRESSES[:1]).receive(data) == [DecodedFrame(3, (None,))]


WRONG = {
    "no frame number": (bundle(message("/marker/main", 1.0, 2.0, 3.0)).dgram, "no message /frame"),
    "half a frame": (bundle(message("/frame", 1.5)).dgram, "no message /frame"),
    "two numbers": (bundle(message("/frame", 1), message("/marker/main", 1.0, 2.0)).dgram, "three numbers"),
    "far": (bundle(message("/frame", 1), message("/marker/main", 1e6, 2.0, 0.0)).dgram, "kilometre"),
    "cut off": (OscEncoder(ADDRESSES).encode(7, [(1.0, 2.0, 3.0), None])[:-3], "an element of"),
    "other": (b"hello world", "neither a bundle nor an address"),
    "tags": (b"/frame\0\0abc\0", "no type tags"),
    "type": (b"/frame\0\0,q\0\0", "unknown type 'q'"),
    "deep": (b"#bundle\0" + b"\0" * 8 + b"", "no message /frame"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_no_frame_is_said(case):
    data, says = WRONG[case]
    (event,) = OscDecoder(ADDRESSES).receive(data)
    assert isinstance(event, Malformed)
    assert says in event.problem


def test_bundles_in_bundles_end():
    data = message("/frame", 1).dgram
    for _ in range(12):
        data = b"#bundle\0" + b"\0" * 8 + len(data).to_bytes(4, "big") + data
    assert "bundles in one another" in parse_osc(data).problem


@given(st.one_of(st.binary(max_size=60), st.binary(max_size=60).map(lambda b: b"/a\0\0,ifsb" + b)))
def test_no_bytes_raise(data):
    assert len(OscDecoder(ADDRESSES).receive(data)) == 1
