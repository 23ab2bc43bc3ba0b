"""Lab Streaming Layer: samples of a stream become lines of marker text, so that the raw log is read like any other.

A stream says by its channel labels what it carries: NAME.x, NAME.y, NAME.z (or with _ : or a blank) for each marker,
and `frame` for a counter. Without labels it is x, y, z for each marker in the rig file's order, with the counter
before them where there is one channel more. Without a counter samples are counted here (`SampleCount`): LSL itself
repeats what the network loses, so that only a sender that paused shows as lost frames. Two streams of one name are
refused: nothing tells which of them is the live one. Needs pylsl.
"""

import asyncio
import importlib
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from drivers.mocap.decoders.marker_text import marker_line
from drivers.ports import Clock
from fidim_lab.errors import DeviceError, SetupError

RESOLVE = 5.0
"""s to find a stream"""
ALONE = 1.0
"""s in which a second stream of the name may answer; liblsl asks at least twice in it"""
HOLE = 3.0
"""periods between two samples that are a gap"""
DRIFT = 1e-3
"""s a second by which two clocks may run apart; crystals do by a tenth of it"""
_SEPARATORS = "._: "


@dataclass(frozen=True)
class Channels:
    """The meaning of the channels."""

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


class SampleCount:
    """Numbers samples that carry none: a hole of `HOLE` periods and more in their stamps is frames that were lost.

    A stamp tells a hole only as far as its arrival allows it. No sample comes before it was taken: one whose stamp is
    further ahead of its arrival than any before has had its clock set, and by how much is the rest of the hole.
    """

    def __init__(self, period: float) -> None:
        """period in s."""
        self._period = period
        self._number = 0
        self._stamp: float | None = None
        self._arrival = 0.0
        self._least = 0.0
        """s from stamp to arrival, the least known: two clocks' difference and the shortest way"""

    def next(self, stamp: float, arrival: float) -> int:
        """The number of a sample with its stamp and its arrival, each s by its own clock."""
        delay = arrival - stamp
        before, self._stamp = self._stamp, stamp
        waited, self._arrival = arrival - self._arrival, arrival
        if before is None or stamp < before:
            self._number, self._least = self._number + 1, delay
            return self._number
        gap = stamp - before
        least = self._least + DRIFT * waited
        clock_set = max(0.0, least - delay)
        self._least = min(least, delay)
        periods = (gap - clock_set) / self._period
        self._number += round(periods) if periods > HOLE else 1
        return self._number

    def restart(self) -> None:
        """Another stream has begun."""
        self._stamp = None


class LslFeed:
    """The samples of one LSL stream, found by its name, as lines of marker text in metres."""

    hint = "Is its sender running, is this its name, does the firewall let LSL through (UDP 16571, TCP 16572)?"

    def __init__(
        self,
        clock: Clock,
        stream: str,
        markers: Sequence[str],
        *,
        rate: float,
        unit: float = 1.0,
        sender: str | None = None,
    ) -> None:
        """rate in Hz; unit: m for one unit of the stream; sender: the computer, or source, that counts alone.

        Raises SetupError without pylsl.
        """
        self._clock = clock
        self._stream = stream
        self._markers = tuple(markers)
        self._period = 1.0 / rate
        self._unit = unit
        self._sender = sender
        self._count = SampleCount(self._period)
        self._lsl = _pylsl()
        self._inlet: Any = None
        self._channels = Channels(None, ())
        self.connection = 0

    @property
    def name(self) -> str:
        """The stream's name."""
        return f"motion capture, LSL stream {self._stream!r}"

    async def open(self) -> None:
        """Find the stream and subscribe. Raises DeviceError where there is none, SetupError where markers are not."""
        inlet = await asyncio.to_thread(self._subscribe)
        self._inlet = inlet
        self._count.restart()
        self.connection += 1

    async def receive(self) -> tuple[float, bytes]:
        """The next samples; looked for twice a period."""
        if self._inlet is None:
            try:
                await self.open()
            except SetupError as error:  # the stream that came back carries other channels
                raise DeviceError(self.name, error.message, hint=error.hint) from error
        while True:
            try:
                samples, stamps = self._pull()
            except RuntimeError as error:
                await self.close()
                raise DeviceError(self.name, "the stream was lost.", hint=self.hint) from error
            if stamps:
                now = self._clock.now()
                pairs = zip(samples, stamps, strict=True)
                return now, b"".join([self._line(sample, stamp, now) for sample, stamp in pairs])
            await self._clock.sleep(0.5 * self._period)

    async def close(self) -> None:
        """Let go of the stream."""
        inlet, self._inlet = self._inlet, None
        if inlet is not None:
            await asyncio.to_thread(inlet.close_stream)

    def _pull(self) -> tuple[list[list[float]], list[float]]:
        return ([], []) if self._inlet is None else self._inlet.pull_chunk(0.0)

    def _subscribe(self) -> Any:
        found = self._find()
        inlet = self._lsl.StreamInlet(found[0], recover=False)
        try:
            info = inlet.info(RESOLVE)
            inlet.open_stream(RESOLVE)
        except (RuntimeError, TimeoutError) as error:
            raise DeviceError(self.name, "found, but it does not answer.", hint=self.hint) from error
        self._channels = assign_channels(_labels(info), info.channel_count(), self._markers)
        return inlet

    def _find(self) -> list[Any]:
        """The only stream of the name. Raises DeviceError where there is none, or another one."""
        wanted = f"name={_quoted(self._stream)}"
        if self._sender is not None:
            sender = _quoted(self._sender)
            wanted += f" and (hostname={sender} or source_id={sender})"
        if not self._lsl.resolve_bypred(wanted, 1, RESOLVE):
            raise DeviceError(self.name, f"not found within {RESOLVE:g} s.", hint=self.hint)
        found = self._lsl.resolve_bypred(wanted, 2, ALONE)
        if len(found) > 1:
            listed = ", ".join(sorted(f"source {one.source_id()!r} on {one.hostname()}" for one in found))
            raise DeviceError(
                self.name,
                f"{len(found)} streams have this name: {listed}.",
                hint="End the one that is not the robot's (a recording played back?), or name its computer: sender.",
            )
        return found

    def _line(self, sample: Sequence[float], stamp: float, arrival: float) -> bytes:
        frame = self._channels.frame
        number = self._count.next(stamp, arrival) if frame is None else int(sample[frame])
        places = [[self._unit * sample[k] for k in axes] for axes in self._channels.markers]
        return marker_line(number, [None if any(map(math.isnan, p)) else (p[0], p[1], p[2]) for p in places])


def _quoted(text: str) -> str:
    """As XPath 1.0 writes it, which has no escapes."""
    return f'"{text}"' if "'" in text else f"'{text}'"


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
