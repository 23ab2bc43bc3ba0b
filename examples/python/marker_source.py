"""A marker source by itself: print where a marker is, from Vicon Tracker's UDP object stream.

fidim simulators examples/rigs/simulated.toml      # in another terminal, or the real cameras
python examples/python/marker_source.py 127.0.0.1 20101 marker1
"""

import asyncio
import sys

import numpy as np

from drivers.clock import LoopClock
from drivers.mocap.decoders import MarkerObjects, ViconUdpDecoder
from drivers.mocap.feeds import ByteFeed, UdpFeed
from drivers.mocap.source import StreamMarkerSource


async def watch(feed: ByteFeed, marker: str, rate: float = 100.0, frames: int = 100) -> np.ndarray:
    """Places of so many frames, (frames, 3) m; NaN where the marker was not seen."""
    source = StreamMarkerSource(feed, ViconUdpDecoder(MarkerObjects((marker,))), LoopClock(), rate=rate)
    seen = source.frames()
    await source.start()
    try:
        return np.array([(await anext(seen)).positions[0] or 3 * (np.nan,) for _ in range(frames)])
    finally:
        await source.close()


if __name__ == "__main__":
    host, port, name = sys.argv[1:4]
    places = asyncio.run(watch(UdpFeed(LoopClock(), int(port), host), name))
    print(f"{name} is at {np.nanmean(places, axis=0).round(4)} m, ± {1e3 * np.nanstd(places, axis=0).max():.2f} mm")
