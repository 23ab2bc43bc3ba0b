"""What a source says when something is amiss: at the start of a session, and when our own code is at fault."""

import numpy as np
import pytest

from drivers.clock import LoopClock
from drivers.mocap.decoders import Decoder, MarkerObjects, MarkerTextDecoder, ViconUdpDecoder
from drivers.mocap.decoders.decoder import Event
from drivers.mocap.source import StreamMarkerSource
from fidim_lab.errors import DeviceError, OurBugError
from sim_backends.jumping_loop import run
from sim_backends.mocap.encoders import Encoder, Occluded, TextEncoder, ViconEncoder
from sim_backends.mocap.faults import During, Faults, Occlusion
from sim_backends.mocap.server import MocapServer, ServerFeed, StreamTiming

CLOCK = LoopClock()
RATE = 100.0


def make(encoder: Encoder, decoder: Decoder, faults: Faults | None = None) -> StreamMarkerSource:
    markers = 2 if isinstance(encoder, ViconEncoder) else 1
    server = MocapServer(
        lambda t: [(1.0, 2.0, 3.0)] * markers,
        encoder,
        np.random.default_rng(0),
        StreamTiming(RATE),
        faults=faults or Faults(),
    )
    return StreamMarkerSource(ServerFeed(server, CLOCK), decoder, CLOCK, rate=RATE)


def test_ready_waits_for_the_main_marker() -> None:
    source = make(
        ViconEncoder(["main", "second"]),
        ViconUdpDecoder(MarkerObjects(("main",))),
        Faults(occlusions=(Occlusion(During(0.0, 0.5)),)),
    )

    async def main() -> None:
        await source.start()
        assert (await source.ready(within=2.0)).number == 51
        await source.close()

    run(main())


@pytest.mark.parametrize(
    ("objects", "faults", "message"),
    [
        (("main",), Faults(silences=(During(0.0, 99.0),)), "nothing received for 2.0 s. This is a simulated server"),
        (("Main",), Faults(), "main marker was not seen for 2 s. The stream carries 'main', 'second', not 'Main'"),
        (
            ("second",),
            Faults(occlusions=(Occlusion(During(0.0, 99.0), marker=1),)),
            "not seen for 2 s. The objects are in the stream, but not tracked",
        ),
    ],
)
def test_ready_says_what_is_amiss(objects: tuple[str, ...], faults: Faults, message: str) -> None:
    encoder = ViconEncoder(["main", "second"], occluded=Occluded.ZEROS)
    source = make(encoder, ViconUdpDecoder(MarkerObjects(objects)), faults)

    async def main() -> None:
        await source.start()
        with pytest.raises(DeviceError, match=message):
            await source.ready(within=2.0)
        await source.close()

    run(main())


def test_ready_names_the_wrong_format() -> None:
    source = make(TextEncoder(), MarkerTextDecoder(2))

    async def main() -> None:
        await source.start()
        with pytest.raises(DeviceError, match=r"packets arrived, none of them a frame.* has 4 fields, not 7"):
            await source.ready(within=1.0)
        await source.close()

    run(main())


class Broken:
    modulus = None

    def receive(self, data: bytes) -> list[Event]:
        raise ZeroDivisionError(len(data))

    def restart(self) -> None: ...

    def advice(self) -> str:
        return ""


def test_a_bug_in_a_decoder_is_told_to_the_readers() -> None:
    source = make(TextEncoder(), Broken())

    async def main() -> None:
        frames = source.frames()
        await source.start()
        with pytest.raises(OurBugError, match="its reader stopped: ZeroDivisionError"):
            await anext(frames)
        await source.close()

    run(main())
