"""NatNet: frames written here by hand, of each version's layout; damaged ones; a silent server is greeted again."""

import asyncio
import socket
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.clock import LoopClock
from drivers.mocap.asked_udp import AskedUdpFeed, Greeting
from drivers.mocap.decoders import NatNetDecoder, describe
from drivers.mocap.decoders.decoder import DecodedFrame, Malformed
from drivers.mocap.decoders.natnet import hello, invitation, keep_alive, marker_id
from drivers.mocap.source import StreamMarkerSource
from sim_backends.mocap.natnet import NatNetEncoder, NatNetServer
from sim_backends.mocap.server import MocapServer, StreamTiming

INFO = b"\x01\x00" + (256 + 8).to_bytes(2, "little") + b"Motive".ljust(256, b"\0") + bytes((3, 0, 0, 0))
BODY = struct.pack("<I7ffH", 1, *[0.0] * 7, 1e-4, 1)


def info(version):
    return INFO + bytes((*version, 0, 0))


def part(count, items, sized):
    return struct.pack("<I", count) + (struct.pack("<I", len(items)) if sized else b"") + items


def frame(number, labelled, *, sized, skeletons=2, sets=(b"robot", b"all")):
    """labelled: (asset, number, x, y, z, flags)."""
    named = b"".join(name + b"\0" + struct.pack("<I6f", 2, *range(6)) for name in sets)
    bones = b"".join(struct.pack("<II", 9, 2) + 2 * BODY for _ in range(skeletons))
    parts = part(len(sets), named, sized) + part(1, struct.pack("<3f", 9.0, 9.0, 9.0), sized)
    parts += part(1, BODY, sized) + part(skeletons, bones, sized)
    if sized:  # an asset with a rigid body and a marker
        parts += part(1, struct.pack("<II", 4, 1) + BODY + struct.pack("<II3ffHf", 1, 5, *[0.0] * 4, 0, 0.0), sized)
    marks = b"".join(struct.pack("<HH3ffHf", n, a, *place, 0.01, flags, 0.0) for a, n, *place, flags in labelled)
    parts += part(len(labelled), marks, sized)
    body = struct.pack("<I", number) + parts + bytes(60)
    return b"\x07\x00" + len(body).to_bytes(2, "little") + body


MARKS = [(1, 2, 0.5, -0.25, 1.0, 0x0A), (1, 1, 1.5, 0.0, 2.0, 0x0A), (2, 7, 9.0, 9.0, 9.0, 0x0A)]


@pytest.mark.parametrize(("version", "sized"), [((3, 0), False), ((3, 1), False), ((4, 0), False), ((4, 1), True)])
def test_labelled_markers_by_asset_and_number(version, sized):
    decoder = NatNetDecoder(("1/1", "1/2", "3/1"))
    assert decoder.receive(info(version)) == []
    assert decoder.receive(frame(41, MARKS, sized=sized)) == [
        DecodedFrame(41, ((1.5, 0.0, 2.0), (0.5, -0.25, 1.0), None))
    ]
    assert "besides, the stream has 2/7" in decoder.advice()


def test_what_motive_makes_up_for_a_hidden_marker_is_no_place():
    decoder = NatNetDecoder(("1/1",))
    decoder.receive(info((4, 1)))
    hidden = frame(1, [(1, 1, 0.5, 0.5, 0.5, 0x0D)], sized=True)
    assert decoder.receive(hidden) == [DecodedFrame(1, (None,))]


def test_the_servers_version_comes_first_and_old_ones_are_refused_by_name():
    decoder = NatNetDecoder(("1/1",))
    data = frame(1, MARKS, sized=False)
    (early,) = decoder.receive(data)
    assert isinstance(early, Malformed)
    assert "before the server has sent its version" in early.problem
    decoder.receive(info((2, 10)))
    (old,) = decoder.receive(data)
    assert isinstance(old, Malformed)
    assert old.problem == "NatNet 2.10: this program reads 3.0 (Motive 2.0) and later"
    decoder.receive(info((3, 0)))
    assert isinstance(decoder.receive(data)[0], DecodedFrame)
    again = describe(decoder).make()  # a recording may begin after the server has sent it
    decoder.restart()
    assert isinstance(decoder.receive(data)[0], Malformed)
    assert isinstance(again.receive(data)[0], DecodedFrame)


@pytest.mark.parametrize("sized", [False, True])
def test_a_frame_cut_anywhere_before_its_labelled_markers_end_is_malformed(sized):
    decoder = NatNetDecoder(("1/1",))
    decoder.receive(info((4, 1) if sized else (3, 0)))
    whole = frame(1, MARKS, sized=sized)
    for end in range(len(whole)):
        (event,) = decoder.receive(whole[:end])
        assert isinstance(event, Malformed)
        body = whole[4 : max(end, 4)]
        told = decoder.receive(b"\x07\x00" + len(body).to_bytes(2, "little") + body)  # a length that agrees
        assert isinstance(told[0], Malformed) or end >= len(whole) - 60


@given(st.binary(max_size=200), st.booleans())
def test_no_bytes_raise(data, sized):
    decoder = NatNetDecoder(("1/1",))
    decoder.receive(info((4, 1) if sized else (3, 0)))
    for bytes_ in (data, b"\x07\x00" + len(data).to_bytes(2, "little") + data):
        for event in decoder.receive(bytes_):
            assert isinstance(event, DecodedFrame | Malformed)


def test_a_marker_a_kilometre_away_is_damage():
    decoder = NatNetDecoder(("1/1",))
    decoder.receive(info((3, 0)))
    (event,) = decoder.receive(frame(1, [(1, 1, 0.0, 1e6, 0.0, 0)], sized=False))
    assert isinstance(event, Malformed)


@pytest.mark.parametrize("name", ["", "1", "a/b", "1/", "/1", "1/65536", "65536/1", "1/-1", "١/1"])
def test_names_that_are_none(name):
    assert marker_id(name) is None
    with pytest.raises(ValueError, match="ASSET/NUMBER"):
        NatNetDecoder((name,))


MANY = {
    "(0, 0, 0) not flagged": ([(1, 1, 0.0, 0.0, 0.0, 0)], None),
    "NaN": ([(1, 1, float("nan"), 0.0, 0.0, 0)], None),
    "the only one without a label": ([(0, 50123 & 0xFFFF, 1.0, 2.0, 3.0, 0x10)], (1.0, 2.0, 3.0)),
    "two without a label": ([(0, 9, 1.0, 2.0, 3.0, 0x10), (0, 8, 1.0, 2.0, 4.0, 0x10)], None),
}


@pytest.mark.parametrize("case", MANY)
def test_what_is_a_place(case):
    marks, place = MANY[case]
    decoder = NatNetDecoder(("unlabelled" if "label" in case else "1/1",))
    decoder.receive(info((4, 1)))
    assert decoder.receive(frame(1, marks, sized=True)) == [DecodedFrame(1, (place,))]


def test_two_markers_of_one_name_are_none():
    decoder = NatNetDecoder(("1/1",))
    decoder.receive(info((4, 1)))
    (event,) = decoder.receive(frame(1, [(1, 1, 1.0, 2.0, 3.0, 0), (1, 1, 9.0, 2.0, 3.0, 0)], sized=True))
    assert isinstance(event, Malformed)
    assert "marker 1/1 is in two places" in event.problem


def test_a_server_invites_to_its_group():
    where = struct.pack("<QH?4s", 10**9, 1511, True, bytes((239, 255, 42, 99)))
    assert invitation(info((4, 1)) + where) == ("239.255.42.99", 1511)
    assert invitation(info((4, 1)) + where.replace(b"\1\xef", b"\0\xef")) is None
    assert invitation(info((4, 1))) is None
    assert invitation(frame(1, MARKS, sized=True) + bytes(300)) is None


def test_frames_of_a_multicast_group():
    """The server answers the one that asked, and streams to the group; what another one sends there is left out."""

    async def main():
        clock = LoopClock()
        encoder = NatNetEncoder([(1, 1)])
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
            free.bind(("127.0.0.1", 0))
            group = ("239.255.42.99", free.getsockname()[1])
        mocap = MocapServer(
            lambda t: [(1.0, 2.0, 3.0)], encoder, np.random.default_rng(0), StreamTiming(100.0), noise=0.0
        )
        server = NatNetServer(mocap, encoder.about(group), clock, group=group)
        await server.start()
        feed = AskedUdpFeed(clock, "127.0.0.1", server.port, Greeting(hello(), keep_alive()), invitation)
        source = StreamMarkerSource(feed, NatNetDecoder(("1/1",)), clock, rate=100.0)
        await source.start()
        seen = await source.ready(3.0)
        await source.close()
        await server.close()
        return seen.positions

    assert asyncio.run(main()) == ((1.0, 2.0, 3.0),)


def test_messages_as_other_clients_send_them():
    assert hello() == b"\x00\x00\x05\x00Ping\x00"
    assert keep_alive() == b"\x0a\x00\x01\x00\x00"


class Server(asyncio.DatagramProtocol):
    def __init__(self):
        self.asked = []

    def connection_made(self, transport):
        self.transport = transport

    def datagram_received(self, data, addr):
        self.asked.append(data)
        if data == b"hello":
            self.transport.sendto(b"here", addr)


def test_a_server_is_greeted_kept_alive_and_greeted_again_after_silence():
    async def main():
        server, clock = Server(), LoopClock()
        loop = asyncio.get_running_loop()
        transport, _ = await loop.create_datagram_endpoint(lambda: server, local_addr=("127.0.0.1", 0))
        feed = AskedUdpFeed(
            clock, "127.0.0.1", transport.get_extra_info("sockname")[1], Greeting(b"hello", b"alive", 0.05)
        )
        await feed.open()
        assert (await feed.receive())[1] == b"here"
        assert feed.connection == 1
        while server.asked.count(b"hello") < 2:
            await clock.sleep(0.01)
        assert server.asked[:2] == [b"hello", b"alive"]  # what was silent for long is greeted again
        await feed.close()
        await feed.close()
        transport.close()

    async def limited():
        async with asyncio.timeout(10.0):
            await main()

    asyncio.run(limited())
