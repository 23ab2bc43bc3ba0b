"""The examples that use a driver by itself, run as they stand: against a drive and cameras in this process."""

import runpy
from pathlib import Path

import numpy as np

from drivers.clock import LoopClock
from sim_backends.jumping_loop import run
from sim_backends.mocap.encoders import ViconEncoder
from sim_backends.mocap.server import MocapServer, ServerFeed, StreamTiming

EXAMPLES = Path(__file__).parents[2] / "examples" / "python"
PLACE = (1.25, -0.5, -0.75)


def test_a_marker_source_by_itself() -> None:
    example = runpy.run_path(str(EXAMPLES / "marker_source.py"))

    async def main() -> np.ndarray:
        clock = LoopClock()
        server = MocapServer(
            lambda t: np.array([PLACE]),
            ViconEncoder(["marker1"]),
            np.random.default_rng(0),
            StreamTiming(100.0),
            noise=1e-6,
        )
        return await example["watch"](ServerFeed(server, clock), "marker1")

    places = run(main())
    assert places.shape == (100, 3)
    np.testing.assert_allclose(places, np.tile(PLACE, (100, 1)), atol=1e-5)
