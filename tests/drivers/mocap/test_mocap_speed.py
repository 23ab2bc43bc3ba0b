import time

import numpy as np
import pytest

from drivers.clock import LoopClock
from drivers.mocap.decoders import MarkerObjects, ViconUdpDecoder
from drivers.mocap.source import StreamMarkerSource
from sim_backends.jumping_loop import run
from sim_backends.mocap.encoders import ViconEncoder
from sim_backends.mocap.server import MocapServer, ServerFeed, StreamTiming

FRAMES = 10_000


@pytest.mark.slow
def test_a_frame_costs_microseconds() -> None:
    """A dry run passes 50 000 frames. About 28 µs each with simulator and loop, half of it ours; twice is a bug."""
    place = np.array([[1.0, 2.0, 3.0]])
    clock = LoopClock()

    async def main() -> None:
        server = MocapServer(lambda t: place, ViconEncoder(["p"]), np.random.default_rng(1), StreamTiming(200.0))
        source = StreamMarkerSource(
            ServerFeed(server, clock), ViconUdpDecoder(MarkerObjects(("p",))), clock, rate=200.0
        )
        frames = source.frames()
        await source.start()
        for _ in range(FRAMES):
            await anext(frames)
        await source.close()

    costs: list[float] = []
    for _ in range(3):
        start = time.process_time()
        run(main())
        costs.append((time.process_time() - start) / FRAMES)
    assert min(costs) < 60e-6
