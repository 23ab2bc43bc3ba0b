"""The simulated server as an LSL stream: a channel for the frame number, three for each marker, NaN where occluded."""

import asyncio
import importlib
import math
from collections.abc import Sequence
from typing import Any

from drivers.ports import Clock
from fidim_lab.errors import SetupError
from sim_backends.mocap.encoders import Positions
from sim_backends.mocap.server import MocapServer


class LslSender:
    """Publishes a server's frames through liblsl. Not simulated: delays on the network and faults of packets."""

    def __init__(self, server: MocapServer, clock: Clock, stream: str, markers: Sequence[str]) -> None:
        """stream is the name by which it is found. Raises SetupError without pylsl."""
        self._server = server
        self._clock = clock
        self._stream = stream
        self._markers = tuple(markers)
        self._outlet: Any = None
        self._task: asyncio.Task[None] | None = None
        try:
            self._lsl: Any = importlib.import_module("pylsl")
        except (ImportError, RuntimeError) as error:
            raise SetupError(f"An LSL stream cannot be simulated: {error}", hint="pip install pylsl") from error

    async def start(self) -> None:
        """Publish and begin to send."""
        count = 1 + 3 * len(self._markers)
        info = self._lsl.StreamInfo(self._stream, "MoCap", count, self._server.timing.rate, "double64", self._stream)
        channels = info.desc().append_child("channels")
        for label in ("frame", *(f"{marker}.{axis}" for marker in self._markers for axis in "xyz")):
            channels.append_child("channel").append_child_value("label", label)
        self._outlet = self._lsl.StreamOutlet(info)
        self._task = asyncio.ensure_future(self._send())

    async def close(self) -> None:
        """The stream ends."""
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)
        self._outlet = None

    async def _send(self) -> None:
        timing, start = self._server.timing, self._clock.now()
        index = 0
        while True:
            since = index * timing.period
            wait = start + since - self._clock.now()
            if wait > 0.0:
                await self._clock.sleep(wait)
            positions = self._server.measure(since, start + since)
            self._outlet.push_sample([float(timing.first_number + index), *_flat(positions)])
            index += 1


def _flat(positions: Positions) -> list[float]:
    nan = (math.nan, math.nan, math.nan)
    return [value for position in positions for value in (nan if position is None else position)]
