"""LSL: which channel is what, and a real round trip through liblsl."""

import asyncio

import numpy as np
import pytest

from drivers.clock import LoopClock
from drivers.mocap.decoders import MarkerTextDecoder
from drivers.mocap.lsl_feed import Channels, LslFeed, SampleCount, assign_channels
from drivers.mocap.source import StreamMarkerSource
from fidim_lab.errors import DeviceError, SetupError
from sim_backends.mocap.encoders import TextEncoder
from sim_backends.mocap.faults import During, Faults, Occlusion
from sim_backends.mocap.lsl_sender import LslSender
from sim_backends.mocap.server import MocapServer, StreamTiming

CLOCK = LoopClock()
ASSIGNED = {
    "labels": (["a.x", "main_x", "main_y", "main_z", "Frame"], Channels(4, ((1, 2, 3),))),
    "other separators": (["main X", "main Y", "main Z"], Channels(None, ((0, 1, 2),))),
    "no labels": (["", "", ""], Channels(None, ((0, 1, 2),))),
    "no labels, counter": (["", "", "", ""], Channels(0, ((1, 2, 3),))),
}


@pytest.mark.parametrize("case", ASSIGNED)
def test_channels_are_known_by_label_or_order(case):
    labels, channels = ASSIGNED[case]
    assert assign_channels(labels, len(labels), ["main"]) == channels


@pytest.mark.parametrize(("labels", "says"), [(["a.x", "a.y", "a.z"], "it carries a.x"), ([""] * 5, "5 channels")])
def test_a_marker_that_is_not_there_is_named(labels, says):
    with pytest.raises(SetupError, match=says):
        assign_channels(labels, len(labels), ["main"])


def run(main):
    async def limited():
        async with asyncio.timeout(40.0):
            return await main()

    return asyncio.run(limited())


@pytest.mark.peer
def test_round_trip_through_liblsl():
    pytest.importorskip("pylsl", exc_type=ImportError)
    faults = Faults(occlusions=(Occlusion(During(0.0, 1e9), marker=1),))
    server = MocapServer(
        lambda t: [(1.0, 2.0, 3.0), (0.0, 0.0, 0.0)],
        TextEncoder(),
        np.random.default_rng(0),
        StreamTiming(100.0),
        noise=0.0,
        faults=faults,
    )

    async def main():
        sender = LslSender(server, CLOCK, "fidim-test-round-trip", ["main", "second"])
        await sender.start()
        feed = LslFeed(CLOCK, "fidim-test-round-trip", ["main", "second"], rate=100.0)
        source = StreamMarkerSource(feed, MarkerTextDecoder(2, checksum_required=True), CLOCK, rate=100.0)
        await source.start()
        await source.ready(5.0)
        reader = source.frames()
        frames = [await anext(reader) for _ in range(50)]
        await sender.close()
        with pytest.raises(DeviceError):
            await until_it_fails(reader)
        await source.close()
        return frames

    frames = run(main)
    assert {frame.positions for frame in frames} == {((1.0, 2.0, 3.0), None)}
    numbers = [frame.number for frame in frames]
    assert numbers == list(range(numbers[0], numbers[0] + 50))


async def until_it_fails(reader):
    async for _ in reader:
        pass


@pytest.mark.slow
def test_a_stream_that_is_not_there():
    pytest.importorskip("pylsl", exc_type=ImportError)

    async def main():
        feed = LslFeed(CLOCK, "fidim-test-nobody", ["main"], rate=100.0)
        with pytest.raises(DeviceError, match="not found within 5 s"):
            await feed.open()

    run(main)


STEPS = {
    "one sample after the other": ([0.01] * 4, 4),
    "a sender that paused for half a second": ([0.01, 0.51, 0.01], 53),
    "a clock that was set 15 s ahead": ([0.01, (15.01, 0.01), 0.01], 3),
    "a clock that was set back": ([0.01, (-15.0, 0.01), 0.01], 3),
    "a pause, in which the clock was set": ([0.01, (15.51, 0.51), 0.01], 53),
    "a network that held two samples back": ([0.01, (0.01, 0.4), (0.01, 0.0)], 3),
}


@pytest.mark.parametrize("case", STEPS)
def test_samples_are_counted_by_stamp_as_far_as_their_arrival_allows(case):
    """Each step of the stamp in s, and of the arrival where it is another."""
    steps, moved = STEPS[case]
    count = SampleCount(0.01)
    stamp, arrival = 1000.0, 50.0
    first = last = count.next(stamp, arrival)
    for step in steps:
        by_stamp, by_arrival = step if isinstance(step, tuple) else (step, step)
        stamp, arrival = stamp + by_stamp, arrival + by_arrival
        last = count.next(stamp, arrival)
    assert last - first == moved


@pytest.mark.peer
def test_two_streams_of_one_name_are_refused_and_both_are_named():
    lsl = pytest.importorskip("pylsl", exc_type=ImportError)
    name = "fidim-test-two"
    outlets = [lsl.StreamOutlet(lsl.StreamInfo(name, "MoCap", 3, 100.0, "float32", who)) for who in ("live", "replay")]

    async def main():
        with pytest.raises(DeviceError, match=r"2 streams have this name: source 'live' on .*, source 'replay' on"):
            await LslFeed(CLOCK, name, ["main"], rate=100.0).open()
        one = LslFeed(CLOCK, name, ["main"], rate=100.0, sender="live")
        await one.open()
        await one.close()

    run(main)
    assert len(outlets) == 2
