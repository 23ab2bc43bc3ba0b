"""The MCAP file of one window: rows, every winch sample seen, the marker's pose, guards and events, with their times.

Written beside the window's CSV file. log_time is the host's monotonic time at which something was recorded,
publish_time that at which it was true; the source's own counter is in the message. docs/files.md lists the topics.
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from drivers.ports import Disk, MarkerFrame, WinchSample
from fidim_lab.data.files.mcap_encoder import McapEncoder, nanoseconds
from fidim_lab.data.files.mcap_schemas import ERROR, GUARD, INFO, LOG, POSE, WARNING, WINCH, messages, timestamp
from fidim_lab.data.window_mcap import PROFILE, add_row_channel, encode_row
from procedures.events import Event, Paused, Prompted, Resumed, StepFinished, StepStarted, Tripped, Warned
from procedures.guards.guard import Trip
from procedures.recording.part_file import PartFile, WriteBytes

MARKER = "/marker/1"
GUARDS = "/guards"
EVENTS = "/events"
FRAME_ID = "world"


def winch_topic(cable: int) -> str:
    """Of a cable, counted from 1."""
    return f"/winch/{cable}"


class WindowLog:
    """Open from the first row to the verdict. Nothing here waits for the disk; its errors are `Disk.error`."""

    def __init__(
        self,
        final: Path,
        about: Mapping[str, str],
        newton_per_ampere: Sequence[float],
        rate: float,
        disk: Disk,
        write: WriteBytes,
        further: Sequence[str],
    ) -> None:
        """`final`: windows/ID.mcap; `newton_per_ampere`: one for each winch, NaN where unknown; `rate` in Hz.

        `further`: names of the columns after those that the format names.
        """
        self.file = PartFile(final, disk, write)
        self._factors = tuple(newton_per_ampere)
        self._rate = rate
        self._seen = [-math.inf] * len(self._factors)
        self._encoder = encoder = McapEncoder(profile=PROFILE)
        self._messages = messages()
        encoder.add_metadata("fidim-window", dict(about))
        self._rows = add_row_channel(encoder, further)
        self._pose = self._channel(MARKER, POSE)
        self._winches = [self._channel(winch_topic(k), WINCH) for k in range(1, len(self._factors) + 1)]
        self._guards = self._channel(GUARDS, GUARD)
        self._events = self._channel(EVENTS, LOG)

    def _channel(self, topic: str, schema: str) -> int:
        return self._encoder.add_channel(topic, self._messages.schema(schema), "protobuf")

    def row(self, now: float, index: int, values: Sequence[float], frame: MarkerFrame | None, markers: int) -> None:
        """One row: t, 3 · markers coordinates, lengths, currents, further; `frame` is None for one that was lost."""
        t, rest, n = values[0], values[1:], len(self._factors)
        parts = (rest[: 3 * markers], rest[3 * markers : 3 * markers + n], rest[3 * markers + n : 3 * markers + 2 * n])
        further = rest[3 * markers + 2 * n :]
        if frame is None:
            line = encode_row(index, t, parts, host_time=math.nan, device_time=math.nan, further=further)
            self._encoder.add(self._rows, nanoseconds(now), line)
            return
        source = {"host_time": frame.t, "device_time": frame.number / self._rate, "device_frame": frame.number}
        line = encode_row(index, t, parts, **source, further=further)
        self._encoder.add(self._rows, nanoseconds(now), line, nanoseconds(frame.t))
        if frame.main is not None:
            self._place(now, frame.t, frame.main)

    def winches(self, now: float, samples: Sequence[WinchSample | None]) -> None:
        """The samples of the winches, without those already written."""
        for k, sample in enumerate(samples):
            if sample is None or sample.t <= self._seen[k]:
                continue
            self._seen[k] = sample.t
            data = self._messages.encode(
                WINCH,
                cable=k + 1,
                host_time=sample.t,
                state=sample.state.value,
                length=sample.length,
                velocity=sample.velocity,
                current=sample.current,
                tension=self._factors[k] * sample.current,
                target_reached=sample.target_reached,
                fault=sample.fault,
            )
            self._encoder.add(self._winches[k], nanoseconds(now), data, nanoseconds(sample.t))

    def event(self, event: Event) -> None:
        """Events of the run: steps, prompts, guards, the verdict. Never touches the disk."""
        match event:
            case Tripped(t=t, trip=trip):
                self._trip(t, ERROR, trip)
            case Warned(t=t, trip=trip):
                self._trip(t, WARNING, trip)
            case Paused(t=t, window=window, says=says):
                self._say(t, WARNING, window, f"paused: {says}")
            case Resumed(t=t, window=window, says=says):
                self._say(t, INFO, window, f"resumed: {says}")
            case StepStarted(t=t, step=step):
                self._say(t, INFO, step.window, step.text)
            case StepFinished(t=t, step=step, result=result):
                reason = f": {result.reason}" if result.reason else ""
                self._say(t, INFO, step.window, f"{step.text}: {result.outcome}{reason}")
            case Prompted(t=t, window=window, prompt=prompt):
                self._say(t, INFO, window, prompt.text)
            case _:
                pass

    def flush(self) -> None:
        """Close the open chunk and hand it to the disk."""
        self.file.add(self._encoder.flush())
        self.file.flush()

    def finish(self) -> None:
        """Hand the rest and the index to the disk; the file is whole then, and can be sealed."""
        self.file.add(self._encoder.finish())
        self.file.flush()

    def _trip(self, t: float, level: int, trip: Trip) -> None:
        told = {"guard": trip.guard, "says": trip.says, "reaction": trip.reaction.value}
        data = self._messages.encode(GUARD, host_time=trip.t, **told)
        self._encoder.add(self._guards, nanoseconds(t), data, nanoseconds(trip.t))
        self._say(t, level, trip.guard, f"{trip.says}: {trip.reaction.value}")

    def _say(self, t: float, level: int, name: str, text: str) -> None:
        data = self._messages.encode(LOG, timestamp=timestamp(t), level=level, message=text, name=name)
        self._encoder.add(self._events, nanoseconds(t), data)

    def _place(self, now: float, t: float, place: Sequence[float]) -> None:
        position = dict(zip("xyz", place, strict=True))
        pose = {"position": position, "orientation": {"w": 1.0}}
        data = self._messages.encode(POSE, timestamp=timestamp(t), frame_id=FRAME_ID, pose=pose)
        self._encoder.add(self._pose, nanoseconds(now), data, nanoseconds(t))
