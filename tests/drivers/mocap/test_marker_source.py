"""The whole chain on a clock that jumps: simulated server, bytes, decoder, sequencing, readers."""

import asyncio
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from drivers.clock import LoopClock
from drivers.mocap.clock_fit import fit_clock
from drivers.mocap.decoders import Decoder, MarkerObjects, MarkerTextDecoder, ViconUdpDecoder
from drivers.mocap.source import StreamMarkerSource
from drivers.ports import MarkerFrame, MarkerSource
from fidim_lab.errors import DeviceError, OurBugError
from sim_backends.jumping_loop import run
from sim_backends.mocap.encoders import Encoder, TextEncoder, ViconEncoder
from sim_backends.mocap.faults import During, Faults, Freeze, Jump, Occlusion
from sim_backends.mocap.server import MocapServer, ServerFeed, StreamTiming

CLOCK = LoopClock()
RATE = 100.0


def truth(t: float) -> np.ndarray:
    return np.array([[1.0 + 0.1 * np.sin(t), -0.2, -0.3], [1.5, 0.2, -0.1 + 0.01 * t]])


def codec(kind: str) -> tuple[Encoder, Decoder]:
    if kind == "text":
        return TextEncoder(), MarkerTextDecoder(2, checksum_required=True)
    return ViconEncoder(["main", "second"]), ViconUdpDecoder(MarkerObjects(("main", "second")))


class Rig:
    """A server and a source that reads it, in process."""

    def __init__(
        self,
        faults: Faults | None = None,
        *,
        kind: str = "vicon",
        timing: StreamTiming | None = None,
        noise: float = 1e-4,
        **options: Any,
    ) -> None:
        encoder, decoder = codec(kind)
        timing = timing or StreamTiming(RATE)
        rng = np.random.default_rng(3)
        self.server = MocapServer(truth, encoder, rng, timing=timing, noise=noise, faults=faults or Faults())
        self.source = StreamMarkerSource(ServerFeed(self.server, CLOCK), decoder, CLOCK, rate=timing.rate, **options)

    async def record(self, seconds: float) -> list[MarkerFrame]:
        """All frames of the first `seconds` of the stream."""
        frames = self.source.frames()
        await self.source.start()
        await CLOCK.sleep(seconds + 0.5 / RATE)  # no frame is due at that instant
        await self.source.close()
        return [frame async for frame in frames]


def test_it_is_the_port() -> None:
    source: MarkerSource = Rig().source
    assert source.latest() is None
    assert source.rate == RATE


@pytest.mark.parametrize("kind", ["vicon", "text"])
def test_every_frame_arrives_in_time_and_place(kind: str) -> None:
    rig = Rig(kind=kind, timing=StreamTiming(RATE, latency=4e-3), noise=0.0)

    async def main() -> None:
        start = CLOCK.now()
        frames = await rig.record(10.0)
        assert [frame.number for frame in frames] == list(range(1, len(frames) + 1))
        assert len(frames) == 1000
        for frame in frames:
            exposed = start + frame.number / RATE
            assert frame.t == pytest.approx(exposed + 4e-3, abs=1e-6)
            assert np.allclose(np.array(frame.positions), truth(exposed), atol=1e-7)

    run(main())
    assert rig.source.counters() == dict.fromkeys(rig.source.counters(), 0) | {"received": 1000}


@pytest.mark.parametrize("kind", ["vicon", "text"])
@pytest.mark.parametrize("length", [0.2, 3.0])
def test_an_occluded_marker_is_none_and_no_frame_is_lost(kind: str, length: float) -> None:
    rig = Rig(Faults(occlusions=(Occlusion(During(1.0, 1.0 + length), marker=0),)), kind=kind)
    frames = run(rig.record(6.0))
    hidden = [frame.number for frame in frames if frame.positions[0] is None]
    assert hidden == list(range(101, 101 + round(length * RATE)))
    assert all(frame.positions[1] is not None for frame in frames)
    assert rig.source.counters()["lost"] == 0


def test_reordered_packets_are_put_in_order() -> None:
    rig = Rig(Faults(reordered=0.1))
    frames = run(rig.record(30.0))
    assert rig.server.damage.done["reordered"] > 200
    numbers = [frame.number for frame in frames]
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))
    assert rig.source.counters()["lost"] == rig.source.counters()["late"] == 0


def test_torn_datagrams_are_counted_and_left_out() -> None:
    rig = Rig(Faults(torn=0.05))
    frames = run(rig.record(30.0))
    counters = rig.source.counters()
    # A datagram cut in its padding is whole all the same.
    assert 0 < counters["malformed"] <= rig.server.damage.done["torn"]
    assert counters["lost"] == counters["malformed"]
    assert len(frames) == counters["received"] == 3000 - counters["lost"]


def test_torn_lines_are_put_together() -> None:
    rig = Rig(Faults(torn=0.5), kind="text")
    frames = run(rig.record(10.0))
    assert rig.server.damage.done["torn"] > 400
    assert [frame.number for frame in frames] == list(range(1, len(frames) + 1))
    assert rig.source.counters()["malformed"] == 0


def test_lost_and_doubled_packets_are_counted() -> None:
    rig = Rig(Faults(lost=0.05, doubled=0.05))
    frames = run(rig.record(30.0))
    counters = rig.source.counters()
    done = rig.server.damage.done
    assert counters["doubled"] == done["doubled"] > 50
    first, last = frames[0].number, frames[-1].number
    assert counters["lost"] == last - first + 1 - len(frames)
    assert abs(counters["lost"] - done["lost"]) <= 6  # those before the first and after the last cannot be known


def test_garbled_lines_never_become_frames() -> None:
    rig = Rig(Faults(garbled=0.1), kind="text", noise=0.0)

    async def main() -> None:
        start = CLOCK.now()
        frames = await rig.record(20.0)
        assert rig.source.counters()["malformed"] >= rig.server.damage.done["garbled"] > 100
        for frame in frames:
            assert np.allclose(np.array(frame.positions), truth(start + frame.number / RATE), atol=1e-7)

    run(main())


def test_garbled_datagrams_never_stop_the_stream() -> None:
    rig = Rig(Faults(garbled=0.3))
    frames = run(rig.record(20.0))
    numbers = [frame.number for frame in frames]
    assert numbers == sorted(set(numbers))
    assert numbers[-1] <= 2000
    assert len(numbers) > 1200


def test_frozen_and_jumped_markers_pass_as_they_are() -> None:
    faults = Faults(freezes=(Freeze(During(1.0, 1.5)),), jumps=(Jump(During(2.0, 2.1), (0.0, 0.05, 0.0)),))
    rig = Rig(faults)
    frames = run(rig.record(4.0))
    assert rig.source.counters()["repeated"] == 50
    y = np.array([frame.positions[0][1] for frame in frames])
    assert np.flatnonzero(np.abs(y + 0.2) > 0.02).tolist() == list(range(200, 210))


def test_silence_reaches_every_reader_and_the_stream_goes_on() -> None:
    rig = Rig(Faults(silences=(During(2.0, 5.0),)))

    async def read(frames: Any) -> tuple[int, list[str], int]:
        before, said, after = 0, list[str](), 0
        while True:
            try:
                await anext(frames)
                before, after = (before, after + 1) if said else (before + 1, after)
            except DeviceError as error:
                said.append(str(error))
            except StopAsyncIteration:
                return before, said, after

    async def main() -> None:
        readers = [asyncio.ensure_future(read(rig.source.frames())) for _ in range(2)]
        await rig.source.start()
        await CLOCK.sleep(4.5)
        latest = rig.source.latest()
        assert latest is not None
        assert CLOCK.now() - latest.t == pytest.approx(2.5, abs=0.03)
        await CLOCK.sleep(2.505)
        await rig.source.close()
        for before, said, after in await asyncio.gather(*readers):
            assert before == 200
            assert said[0].startswith("simulated motion capture: nothing received for 1.0 s.")
            assert len(said) == 3
            assert after == 200

    run(main())
    assert rig.source.counters()["lost"] == 300


def test_a_slow_reader_gets_what_fits_then_an_error_then_the_end() -> None:
    rig = Rig(queue=50)

    async def main() -> None:
        slow, quick = rig.source.frames(), rig.source.frames()

        async def count() -> int:
            return len([frame async for frame in quick])

        counting = asyncio.ensure_future(count())
        await rig.source.start()
        await CLOCK.sleep(1.005)
        await rig.source.close()
        assert await counting == 100
        assert [(await anext(slow)).number for _ in range(50)] == list(range(1, 51))
        with pytest.raises(DeviceError, match="fell 50 frames behind; frames from number 51 on are missing"):
            await anext(slow)
        with pytest.raises(StopAsyncIteration):
            await anext(slow)

    run(main())
    assert rig.source.counters()["overflow"] == 50


def test_a_reader_that_is_gone_fills_nothing() -> None:
    rig = Rig(queue=10)

    async def main() -> None:
        frames = rig.source.frames()
        await rig.source.start()
        async for _ in frames:
            break
        del frames
        await CLOCK.sleep(1.0)
        await rig.source.close()

    run(main())
    assert rig.source.counters()["overflow"] == 0


def test_frames_begin_when_asked_for() -> None:
    rig = Rig()

    async def main() -> None:
        await rig.source.start()
        await CLOCK.sleep(1.005)
        frames = rig.source.frames()
        await CLOCK.sleep(0.5)
        assert (await anext(frames)).number == 101
        await rig.source.close()
        await rig.source.close()

    run(main())


def test_two_tasks_may_not_share_a_subscription() -> None:
    rig = Rig()

    async def main() -> None:
        frames = rig.source.frames()
        waiting = asyncio.ensure_future(anext(frames))
        await CLOCK.sleep(0.0)
        with pytest.raises(OurBugError, match="two tasks read one subscription"):
            await anext(frames)
        await rig.source.start()
        assert (await waiting).number == 1
        await rig.source.close()

    run(main())


def test_the_same_seed_gives_the_same_frames() -> None:
    faults = Faults(lost=0.02, doubled=0.02, reordered=0.02, torn=0.02, garbled=0.02)
    timing = StreamTiming(RATE, drift=30e-6, latency=4e-3, jitter=5e-4, spikes=0.01)
    first, second = (run(Rig(faults, timing=timing).record(20.0)) for _ in range(2))
    assert first == second
    assert run(Rig(replace(faults, lost=0.03), timing=timing).record(20.0)) != first


def test_its_clock_finds_the_servers() -> None:
    rig = Rig(timing=StreamTiming(200.0, drift=30e-6, latency=4e-3, jitter=5e-4, spikes=0.01))
    frames = run(rig.record(12.0))
    fit = fit_clock([frame.number for frame in frames], [frame.t for frame in frames], 200.0)
    assert fit is not None
    assert fit.rate == pytest.approx(1.0 + 30e-6, abs=1.5e-6)
    assert fit.time(1400) == pytest.approx(1400 * (1.0 + 30e-6) / 200.0 + 4e-3, abs=5e-6)
    # The server keeps packets in order, so that one that is held up holds up those behind it.
