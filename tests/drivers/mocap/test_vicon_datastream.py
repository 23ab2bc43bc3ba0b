"""Vicon DataStream: bytes as the vendor's client reads them, cut anywhere, damaged, renamed, reconnected."""

import asyncio
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.clock import LoopClock
from drivers.mocap.decoders import ViconDataStreamDecoder
from drivers.mocap.decoders.decoder import DecodedFrame, Malformed
from drivers.mocap.decoders.vicon_datastream import DataStreamWishes, wish
from drivers.mocap.decoders.vicon_packets import PacketSplitter, StreamPacket
from drivers.mocap.feeds import TcpFeed
from drivers.mocap.source import StreamMarkerSource
from fidim_lab.errors import DeviceError
from sim_backends.jumping_loop import run as run_jumping
from sim_backends.mocap.datastream import OFFERED, DataStreamEncoder, DataStreamSession
from sim_backends.mocap.faults import During, Faults, Occlusion
from sim_backends.mocap.server import MocapServer, ServerFeed, StreamTiming
from sim_backends.mocap.sockets import TcpServer

CLOCK = LoopClock()


def block(kind, body):
    return struct.pack("<II", kind, len(body)) + body


def packet(*blocks):
    body = b"".join(blocks)
    return bytes.fromhex("01002b1a") + struct.pack("<I", len(body)) + body


def subject(number, name, markers):
    text = struct.pack("<I", len(name)) + name
    listed = b"".join(struct.pack("<II", k, len(m)) + m for k, m in enumerate(markers))
    body = struct.pack("<I", number) + text + struct.pack("<II", 0, len(markers)) + listed + struct.pack("<I", 0)
    return block(2, body)


def recons(*entries):
    body = b"".join(struct.pack("<II13dI", s, m, 7.0, *place, *[0.0] * 9, 0) for s, m, place in entries)
    return block(6, struct.pack("<I", len(entries)) + body)


def frame(number):
    return block(5, struct.pack("<I", number))


PLATFORM = subject(3, b"platform", [b"main", b"second"])


def test_what_the_client_answers_is_what_the_vendors_client_sends():
    # As recorded from the vendor's client (SDK 1.11 in PyPI's motioncapture), for the blocks that it wished for.
    offered = frozenset({1, 2, 5, 100004})
    assert wish(offered) == bytes.fromhex(
        "01002b1a1c000000a1860100140000000400000001000000020000000500000 0a4860100".replace(" ", "")
        + "01002b1a09000000a28601000100000001"
    )


def test_wishes_are_told_once_the_server_has_spoken():
    conversation = DataStreamWishes()
    greeting = packet(block(100001, struct.pack("<4I", 3, 5, 6, 99)))
    assert conversation.receive(greeting[:9]) == b""
    assert conversation.receive(greeting[9:]) == wish(frozenset({5, 6}))
    assert conversation.receive(greeting) == b""


def test_labelled_markers_by_name_in_metres():
    decoder = ViconDataStreamDecoder(("main", "platform/second"))
    data = packet(frame(7), PLATFORM, recons((3, 1, (1.0, 2.0, 3.0)), (3, 0, (1000.0, -500.0, 250.0))))
    assert decoder.receive(data) == [DecodedFrame(7, ((1.0, -0.5, 0.25), (0.001, 0.002, 0.003)))]


def test_a_marker_that_is_not_there_is_occluded_and_so_is_one_at_nan():
    decoder = ViconDataStreamDecoder(("main", "second"))
    data = packet(PLATFORM, frame(1), recons((3, 1, (float("nan"), 0.0, 0.0))))
    assert decoder.receive(data) == [DecodedFrame(1, (None, None))]
    assert "known there, but not seen" in decoder.advice()


def test_what_is_told_once_counts_on_and_what_is_unchanged_is_as_before():
    decoder = ViconDataStreamDecoder(("main",))
    place = recons((3, 0, (1.0, 1.0, 1.0)))
    unchanged = block(100004, struct.pack("<I", 0) + struct.pack("<II", 1, 6))
    events = decoder.receive(packet(PLATFORM, frame(1), place) + packet(unchanged, frame(2)) + packet(frame(3)))
    assert [event.positions[0] for event in events] == [(0.001, 0.001, 0.001), (0.001, 0.001, 0.001), None]


def test_a_name_that_two_subjects_have_tells_nothing():
    decoder = ViconDataStreamDecoder(("main", "hand/main"))
    data = packet(PLATFORM, subject(4, b"hand", [b"main"]), frame(1), recons((3, 0, (1, 1, 1)), (4, 0, (2, 2, 2))))
    assert decoder.receive(data) == [DecodedFrame(1, (None, (0.002, 0.002, 0.002)))]
    assert "platform/main, platform/second, hand/main, not main" in decoder.advice()


def test_latency_and_strays_are_told():
    decoder = ViconDataStreamDecoder(("main",))
    encoder = DataStreamEncoder(["main"], rate=200.0, latency=0.005, strays=[(1.0, 0.0, 0.0), (2.0, 0.0, 0.0)])
    decoder.receive(encoder.encode(1, [None]))
    assert decoder.latency == pytest.approx(0.005)
    assert "2 unlabelled markers are" in decoder.advice()


def test_a_server_without_labelled_markers_is_named():
    decoder = ViconDataStreamDecoder(("main",))
    decoder.receive(packet(block(100001, struct.pack("<2I", 1, 9))))
    assert "no labelled markers" in decoder.advice()


WRONG = {
    "another protocol": (b"HTTP/1.1 400 Bad Request\r\n\r\n", "begins a packet"),
    "length": (bytes.fromhex("01002b1a") + b"\xff" * 8, "length 4294967295"),
    "block beyond its packet": (packet(block(5, b"1234")[:-1] + b""), "block 5 has 4 bytes"),
    "head cut off": (packet(b"\x05\0\0\0"), "head of block 1"),
    "count too large": (packet(frame(1), block(6, b"\xff\xff\xff\x7f")), "items announced"),
    "kilometre": (packet(PLATFORM, frame(1), recons((3, 0, (1e7, 0, 0)))), "more than a kilometre"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_no_frame_is_said(case):
    data, says = WRONG[case]
    events = ViconDataStreamDecoder(("main",)).receive(data)
    assert [says in event.problem for event in events if isinstance(event, Malformed)] == [True]


def test_after_damage_it_goes_on_with_the_next_packet():
    decoder = ViconDataStreamDecoder(("main",))
    good = packet(PLATFORM, frame(2), recons((3, 0, (1.0, 1.0, 1.0))))
    events = decoder.receive(b"\0" * 50 + b"\x01\x00\x2b" + good + b"xx" + good)
    assert [type(event) for event in events] == [Malformed, DecodedFrame, Malformed, DecodedFrame]


def test_after_a_new_connection_an_unfinished_packet_is_forgotten():
    decoder = ViconDataStreamDecoder(("main",))
    good = packet(PLATFORM, frame(2), recons((3, 0, (1.0, 1.0, 1.0))))
    decoder.receive(good[:-5])
    decoder.restart()
    assert decoder.receive(good) == [DecodedFrame(2, ((0.001, 0.001, 0.001),))]


@given(st.lists(st.integers(1, 400), max_size=30))
def test_pieces_cut_anywhere_are_put_together(cuts):
    encoder = DataStreamEncoder(["main"])
    stream = b"".join(encoder.encode(n, [(0.1 * n, 0.0, 0.0)]) for n in range(1, 6))
    decoder, events = ViconDataStreamDecoder(("main",)), []
    for cut in [*cuts, len(stream)]:
        events += decoder.receive(stream[:cut])
        stream = stream[cut:]
    assert [event.number for event in events] == [1, 2, 3, 4, 5]
    assert np.allclose([event.positions[0][0] for event in events], [0.1, 0.2, 0.3, 0.4, 0.5])


@given(
    st.lists(st.one_of(st.binary(max_size=80), st.binary(max_size=60).map(lambda b: packet(block(6, b), block(2, b)))))
)
def test_no_bytes_raise(pieces):
    decoder, splitter = ViconDataStreamDecoder(("main",)), PacketSplitter()
    for piece in pieces:
        assert all(isinstance(event, DecodedFrame | Malformed) for event in decoder.receive(piece))
        assert all(isinstance(item, StreamPacket | Malformed) for item in splitter.receive(piece))


async def consume(reader):
    async for _ in reader:
        pass


def simulated(**options):
    encoder = DataStreamEncoder(["main", "second"], rate=100.0)
    truth = [(1.0, 2.0, 3.0), (-1.0, 0.0, 0.5)]
    return MocapServer(lambda t: truth, encoder, np.random.default_rng(0), StreamTiming(100.0), **options)


def test_faults_of_the_stream_are_counted_as_for_any_source():
    faults = Faults(occlusions=(Occlusion(During(0.5, 0.6)),), lost=0.02, doubled=0.02, torn=0.1)

    async def main():
        server = simulated(faults=faults)
        source = StreamMarkerSource(
            ServerFeed(server, CLOCK), ViconDataStreamDecoder(("main", "second")), CLOCK, rate=100.0
        )
        reader = source.frames()
        await source.start()
        await CLOCK.sleep(5.005)
        await source.close()
        return server.damage.done, source.counters(), [frame async for frame in reader]

    done, counters, frames = run_jumping(main())
    assert counters["lost"] == done["lost"] > 0
    assert counters["doubled"] == done["doubled"] > 0
    assert counters["malformed"] == 0
    hidden = [frame.number for frame in frames if frame.positions[0] is None]
    assert set(hidden) <= set(range(51, 61))
    assert len(hidden) > 5


def test_over_tcp_with_a_server_that_hangs_up():
    async def main():
        server = TcpServer(simulated(noise=0.0), CLOCK, session=DataStreamSession)
        await server.start()
        feed = TcpFeed(CLOCK, "127.0.0.1", server.port, conversation=DataStreamWishes)
        source = StreamMarkerSource(feed, ViconDataStreamDecoder(("main", "platform/second")), CLOCK, rate=100.0)
        await source.start()
        first = await source.ready(5.0)
        reader = source.frames()
        await server.hang_up()
        with pytest.raises(DeviceError, match="closed the connection"):
            await consume(reader)
        again = await source.ready(5.0)
        await source.close()
        await server.close()
        assert first.positions == again.positions == ((1.0, 2.0, 3.0), (-1.0, 0.0, 0.5))
        assert again.number > first.number
        assert feed.connection == 2

    async def limited():
        async with asyncio.timeout(20.0):
            await main()

    asyncio.run(limited())


def kinds(data):
    found = []
    for item in PacketSplitter().receive(data):
        assert isinstance(item, StreamPacket)
        found += [kind for kind, _ in item.blocks]
    return found


def test_a_session_sends_what_was_wished_for_once_it_is_asked():
    encoder, session = DataStreamEncoder(["main"]), DataStreamSession()
    data = encoder.encode(1, [(0.0, 0.0, 0.0)])
    assert kinds(session.greeting()) == [100001]
    assert session.pass_on(data) == b""
    wishes = wish(frozenset({5, 6, 100004}))
    assert session.receive(wishes[:11]) + session.receive(wishes[11:]) == b""
    assert sorted(kinds(session.pass_on(data))) == [5, 6, 100004]
    assert sorted(kinds(data)) == sorted(OFFERED)


def test_a_session_sends_one_frame_for_one_request():
    encoder, session = DataStreamEncoder(["main"]), DataStreamSession()
    data = encoder.encode(1, [(0.0, 0.0, 0.0)])
    session.receive(packet(block(100002, b"\0")))
    assert session.pass_on(data) == data
    assert session.pass_on(data) == b""
