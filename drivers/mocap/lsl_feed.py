"""Lab Streaming Layer: samples of a stream become lines of marker text, so that the raw log is read like any other.

A stream says by its channel labels what it carries: NAME.x, NAME.y, NAME.z (or with _ : or a blank) for each marker,
and `frame` for a counter. Without labels it is x, y, z for each marker in the rig file's order, with the counter
before them where there is one channel more. Without a counter samples are counted here; then only a hole of three
periods and more in their times shows as lost frames (LSL itself repeats what the network loses). Needs pylsl.
"""

import asyncio
import importlib
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from drivers.mocap.marker_text import marker_line
from drivers.ports import Clock
from fidim_lab.errors import DeviceError, SetupError

RESOLVE = 5.0
"""s to find a stream"""
HOLE = 3.0
"""periods between two samples that are a gap"""
_SEPARATORS = "._: "


@dataclass(frozen=True)
class Channels:
    """Which channels are what."""

    frame: int | None
    markers: tuple[tuple[int, int, int], ...]


def assign_channels(labels: Sequence[str], count: int, markers: Sequence[str]) -> Channels:
    """By label, else in order. Raises SetupError with what is there where a marker is not."""
    if not any(labels):
        if count not in (3 * len(markers), 3 * len(markers) + 1):
            raise SetupError(
                f"LSL: the stream has {count} channels without labels; {len(markers)} marker(s) need "
                f"{3 * len(markers)}, or one more with a frame counter first.",
                hint="Label its channels, or name as many markers as it carries.",
            )
        first = count % 3
        return Channels(0 if first else None, tuple((k, k + 1, k + 2) for k in range(first, count, 3)))
    places = {_plain(label): index for index, label in enumerate(labels)}
    found: list[tuple[int, int, int]] = []
    for marker in markers:
        axes = [places.get(f"{_plain(marker)}.{axis}") for axis in "xyz"]
        x, y, z = axes
        if x is None or y is None or z is None:
            carried = ", ".join(labels[:24])
            raise SetupError(f"LSL: the stream has no channels {marker}.x, .y, .z; it carries {carried}.")
        found.append((x, y, z))
    return Channels(places.get("frame"), tuple(found))


def _plain(label: str) -> str:
    for separator in _SEPARATORS:
        label = label.replace(separator, ".")
    return label.strip(".").lower()


class LslFeed:
    """The samples of one LSL stream, found by its name, as lines of marker text in metres."""

    hint = "Is its sender running, is this its name, does the firewall let LSL through (UDP 16571, TCP 16572)?"

    def __init__(self, clock: Clock, stream: str, markers: Sequence[str], *, rate: float, unit: float = 1.0) -> None:
        """rate in Hz; unit: m for one unit of the stream. Raises SetupError without pylsl."""
        self._clock = clock
        self._stream = stream
        self._markers = tuple(markers)
        self._period = 1.0 / rate
        self._unit = unit
        self._lsl = _pylsl()
        self._inlet: Any = None
        self._channels = Channels(None, ())
        self._number = 0
        self._stamp: float | None = None
        self.connection = 0

    @property
    def name(self) -> str:
        """The stream's name."""
        return f"motion capture, LSL stream {self._stream!r}"

    async def open(self) -> None:
        """Find the stream and subscribe. Raises DeviceError where there is none, SetupError where markers are not."""
        inlet = await asyncio.to_thread(self._subscribe)
        self._inlet, self._stamp = inlet, None
        self.connection += 1

    async def receive(self) -> tuple[float, bytes]:
        """The next samples; looked for twice a period."""
        if self._inlet is None:
            await self.open()
        while True:
            try:
                samples, stamps = self._pull()
            except RuntimeError as error:
                await self.close()
                raise DeviceError(self.name, "the stream was lost.", hint=self.hint) from error
            if stamps:
                lines = [self._line(sample, stamp) for sample, stamp in zip(samples, stamps, strict=True)]
                return self._clock.now(), b"".join(lines)
            await self._clock.sleep(0.5 * self._period)

    async def close(self) -> None:
        """Let go of the stream."""
        inlet, self._inlet = self._inlet, None
        if inlet is not None:
            await asyncio.to_thread(inlet.close_stream)

    def _pull(self) -> tuple[list[list[float]], list[float]]:
        return ([], []) if self._inlet is None else self._inlet.pull_chunk(0.0)

    def _subscribe(self) -> Any:
        found = self._lsl.resolve_byprop("name", self._stream, minimum=1, timeout=RESOLVE)
        if not found:
            raise DeviceError(self.name, f"not found within {RESOLVE:g} s.", hint=self.hint)
        inlet = self._lsl.StreamInlet(found[0], recover=False)
        try:
            info = inlet.info(RESOLVE)
            inlet.open_stream(RESOLVE)
        except (RuntimeError, TimeoutError) as error:
            raise DeviceError(self.name, "found, but it does not answer.", hint=self.hint) from error
        self._channels = assign_channels(_labels(info), info.channel_count(), self._markers)
        return inlet

    def _line(self, sample: Sequence[float], stamp: float) -> bytes:
        before, self._stamp = self._stamp, stamp
        if self._channels.frame is not None:
            self._number = int(sample[self._channels.frame])
        else:
            periods = 1.0 if before is None else (stamp - before) / self._period
            self._number += round(periods) if periods > HOLE else 1
        places = [[self._unit * sample[k] for k in axes] for axes in self._channels.markers]
        return marker_line(self._number, [None if any(map(math.isnan, p)) else (p[0], p[1], p[2]) for p in places])


def _labels(info: Any) -> list[str]:
    labels: list[str] = []
    channel = info.desc().child("channels").child("channel")
    for _ in range(info.channel_count()):
        labels.append(str(channel.child_value("label")))
        channel = channel.next_sibling("channel")
    return labels


def _pylsl() -> Any:
    try:
        return importlib.import_module("pylsl")
    except (ImportError, RuntimeError) as error:  # RuntimeError: liblsl is missing
        raise SetupError(
            f"motion_capture, kind: LSL needs the package pylsl: {error}", hint="pip install pylsl"
        ) from error
