"""Real sockets on loopback, in real time; every port is an ephemeral one."""

import asyncio
import socket
from collections.abc import Callable, Coroutine
from typing import Any

import numpy as np
import pytest

from drivers.clock import LoopClock
from drivers.mocap.clock_fit import fit_clock
from drivers.mocap.decoders import MarkerObjects, MarkerTextDecoder, ViconUdpDecoder
from drivers.mocap.feeds import TcpFeed, UdpFeed
from drivers.mocap.source import StreamMarkerSource
from drivers.ports import MarkerFrame
from fidim_lab.errors import DeviceError, SetupError
from sim_backends.mocap.encoders import TextEncoder, ViconEncoder
from sim_backends.mocap.faults import During, Faults, Occlusion
from sim_backends.mocap.server import MocapServer, StreamTiming
from sim_backends.mocap.sockets import TcpServer, UdpSender

CLOCK = LoopClock()
RATE = 400.0


def server(kind: str, faults: Faults | None = None) -> MocapServer:
    encoder = TextEncoder() if kind == "text" else ViconEncoder(["platform"])
    return MocapServer(
        lambda t: [(1.0, 2.0, 3.0)], encoder, np.random.default_rng(0), StreamTiming(RATE), faults=faults or Faults()
    )


def run(main: Callable[[], Coroutine[Any, Any, None]]) -> None:
    async def limited() -> None:
        async with asyncio.timeout(20.0):
            await main()

    asyncio.run(limited())


async def take(source: StreamMarkerSource, count: int) -> list[MarkerFrame]:
    frames = source.frames()
    return [await anext(frames) for _ in range(count)]


def vicon_source(feed: UdpFeed, **options: Any) -> StreamMarkerSource:
    return StreamMarkerSource(feed, ViconUdpDecoder(MarkerObjects(("platform",))), CLOCK, rate=RATE, **options)


@pytest.mark.parametrize("kind", ["vicon", "text"])
def test_datagrams(kind: str) -> None:
    async def main() -> None:
        feed = UdpFeed(CLOCK, 0, "127.0.0.1", sender="127.0.0.1")
        decoder = MarkerTextDecoder(1) if kind == "text" else ViconUdpDecoder(MarkerObjects(("platform",)))
        source = StreamMarkerSource(feed, decoder, CLOCK, rate=RATE)
        await source.start()
        assert feed.name == f"motion capture 127.0.0.1:{feed.port}"
        chance = Faults(
            occlusions=(Occlusion(During(0.1, 0.15)),), doubled=0.05, reordered=0.0 if kind == "text" else 0.05
        )
        sender = UdpSender(server(kind, chance), CLOCK, feed.port)
        await sender.start()
        frames = await take(source, 200)
        fit = fit_clock([frame.number for frame in frames], [frame.t for frame in frames], RATE)
        await sender.close()
        await source.close()
        numbers = [frame.number for frame in frames]
        assert numbers == list(range(numbers[0], numbers[0] + 200))
        hidden = [frame.number for frame in frames if frame.positions[0] is None]
        assert hidden == list(range(41, 61))
        assert np.allclose([frame.positions[0] for frame in frames if frame.positions[0]], [1.0, 2.0, 3.0], atol=1e-3)
        assert source.counters()["doubled"] > 0
        assert fit is not None
        assert fit.rate == pytest.approx(1.0, abs=0.01)

    run(main)


def test_datagrams_of_another_sender_are_not_taken() -> None:
    async def main() -> None:
        feed = UdpFeed(CLOCK, 0, "127.0.0.1", sender="192.0.2.1")
        source = vicon_source(feed)
        await source.start()
        sender = UdpSender(server("vicon"), CLOCK, feed.port)
        await sender.start()
        with pytest.raises(DeviceError, match=r"nothing received for 0\.1 s"):
            await source.ready(within=0.1)
        await sender.close()
        await source.close()

    run(main)


def test_a_silent_stream_is_named_with_what_to_check() -> None:
    async def main() -> None:
        feed = UdpFeed(CLOCK, 0, "127.0.0.1")
        source = vicon_source(feed, silence=0.05)
        frames = source.frames()
        await source.start()
        with pytest.raises(DeviceError) as caught:
            await anext(frames)
        said = str(caught.value)
        assert said.startswith(f"motion capture 127.0.0.1:{feed.port}: nothing received for 0.1 s.")
        assert "enabled in Tracker" in said
        await source.close()

    run(main)


def test_a_taken_port_is_a_mistake_of_the_setup() -> None:
    async def main() -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
            other.bind(("127.0.0.1", 0))
            port = other.getsockname()[1]
            source = vicon_source(UdpFeed(CLOCK, port, "127.0.0.1"))
            with pytest.raises(SetupError, match=rf"127.0.0.1:{port}: cannot listen there.*another program"):
                await source.start()
            await source.close()

    run(main)


def test_a_flood_without_reader_is_counted() -> None:
    async def main() -> None:
        feed = UdpFeed(CLOCK, 0, "127.0.0.1")
        await feed.open()
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
            while feed.overflow == 0:
                other.sendto(b"x", ("127.0.0.1", feed.port))
                await CLOCK.sleep(0.0)
        assert (await feed.receive())[1] == b"x"
        await feed.close()

    run(main)


def test_a_byte_stream() -> None:
    async def main() -> None:
        sender = TcpServer(server("text", Faults(torn=0.5)), CLOCK)
        await sender.start()
        feed = TcpFeed(CLOCK, "127.0.0.1", sender.port)
        source = StreamMarkerSource(feed, MarkerTextDecoder(1, checksum_required=True), CLOCK, rate=RATE)
        await source.start()
        frames = await take(source, 100)
        await source.close()
        await sender.close()
        numbers = [frame.number for frame in frames]
        assert numbers == list(range(numbers[0], numbers[0] + 100))
        assert source.counters()["malformed"] <= 1  # it may have joined in the middle of a torn line

    run(main)


def test_a_lost_connection_is_told_and_made_again() -> None:
    async def main() -> None:
        sender = TcpServer(server("text"), CLOCK)
        await sender.start()
        feed = TcpFeed(CLOCK, "127.0.0.1", sender.port)
        source = StreamMarkerSource(feed, MarkerTextDecoder(1), CLOCK, rate=RATE)
        frames = source.frames()
        await source.start()
        before = [await anext(frames) for _ in range(20)]
        await sender.hang_up()
        said = ""
        while not said:
            try:
                before.append(await anext(frames))
            except DeviceError as error:
                said = error.message
        assert said.endswith("the server closed the connection.")
        after = [await anext(frames) for _ in range(20)]
        await source.close()
        await sender.close()
        assert feed.connection == 2
        hole = after[0].number - before[-1].number - 1
        assert hole >= 20  # 0.1 s of pause
        assert source.counters()["lost"] == hole
        assert source.counters()["resets"] == 0

    run(main)


def test_nobody_there() -> None:
    async def main() -> None:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            port = probe.getsockname()[1]
        source = StreamMarkerSource(TcpFeed(CLOCK, "127.0.0.1", port), MarkerTextDecoder(1), CLOCK, rate=RATE)
        with pytest.raises(DeviceError, match=rf"127.0.0.1:{port}: cannot connect.*Is the server running"):
            await source.start()
        await source.close()

    run(main)


def test_a_server_that_stays_away_is_told_again_and_again() -> None:
    async def main() -> None:
        sender = TcpServer(server("text"), CLOCK)
        await sender.start()
        source = StreamMarkerSource(TcpFeed(CLOCK, "127.0.0.1", sender.port), MarkerTextDecoder(1), CLOCK, rate=RATE)
        await source.start()
        await source.ready(within=5.0)
        frames = source.frames()
        await sender.close()
        said: list[str] = []
        while len(said) < 3:
            try:
                await anext(frames)
            except DeviceError as error:
                said.append(error.message)
        assert "closed the connection" in said[0]
        assert "cannot connect" in said[1]
        assert "cannot connect" in said[2]
        assert source.problem
        await source.close()

    run(main)
