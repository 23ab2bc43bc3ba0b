"""What the windows of a run say that its drivers read: marker frames and winch samples, each to come out again once."""

import math
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from drivers.ports import MarkerFrame, WinchSample
from fidim_lab.data.files.mcap_file import read_mcap
from fidim_lab.data.files.mcap_schemas import ROW, WINCH

_TOLERANCE = 1e-9
"""m, m/s, A: the same bytes by the same arithmetic"""
_MICRO = 1e6
"""times are compared to the µs, as the raw CAN log has them"""
_LAST_DIGIT = 1e-6
"""s"""


@dataclass(frozen=True)
class _Place:
    """Where a value was recorded."""

    window: str
    t: float
    value: Any


@dataclass
class Expected:
    """Recorded values by their source's own keys; what has come out is taken off."""

    windows: tuple[str, ...] = ()
    rows: dict[tuple[int, int], _Place] = field(default_factory=dict[tuple[int, int], _Place])
    """by device frame and arrival, µs"""
    samples: dict[tuple[int, int], _Place] = field(default_factory=dict[tuple[int, int], _Place])
    """by cable (from 0) and SYNC, µs"""
    syncs: tuple[float, ...] = ()
    """s, in order: instants of the SYNCs that samples were recorded with"""
    _passed: float = -math.inf

    def sync(self, logged: float) -> float:
        """The instant by which samples know the SYNC that the log has at `logged` (s); that itself where none does.

        A SYNC is dated when the control loop sends it, and logged when the bus takes it: on a real bus some ten µs
        later, on a busy computer more, but before the next one.
        """
        before, self._passed = self._passed, logged
        k = bisect_right(self.syncs, logged + _LAST_DIGIT) - 1
        return self.syncs[k] if k >= 0 and self.syncs[k] > before + _LAST_DIGIT else logged

    def marker(self, frame: MarkerFrame) -> str | None:
        """None where this frame was not recorded; else what differs, empty where nothing does."""
        place = _taken(self.rows, frame.number, frame.t)
        if place is None:
            return None
        found = [v for p in frame.positions for v in (p or (math.nan,) * 3)][: len(place.value)]
        for k, (was, now) in enumerate(zip(place.value, found, strict=False)):
            if not _same(was, now):
                axis = f"{'xyz'[k % 3]} of marker {k // 3 + 1}"
                return f"{place.window}, frame {frame.number}: {axis} was {was:.6f} m, is {now:.6f} m now"
        return ""

    def sample(self, cable: int, sample: WinchSample, *, arrival: bool = True) -> str | None:
        """None where this sample was not recorded (or came already); else what differs, empty where nothing does.

        arrival: whether the drive itself says that it has arrived. In cyclic modes the host knows: it makes the way.
        """
        place = _taken(self.samples, cable, sample.t)
        if place is None:
            return None
        for name, unit in (("length", "m"), ("velocity", "m/s"), ("current", "A")):
            was, now = getattr(place.value, name), getattr(sample, name)
            if not _same(was, now):
                return f"{place.window}, winch {cable + 1}: {name} was {was:.6f} {unit}, is {now:.6f} {unit} now"
        if arrival and place.value.target_reached != sample.target_reached:
            return f"{place.window}, winch {cable + 1}: target reached was {place.value.target_reached}"
        return ""

    def missing(self) -> Iterator[tuple[float, str]]:
        """What was recorded but did not come out of the raw bytes."""
        for (number, _), place in self.rows.items():
            yield place.t, f"{place.window}: frame {number} was recorded, but the raw bytes do not give it"
        for (cable, _), place in self.samples.items():
            yield place.t, f"{place.window}: a sample of winch {cable + 1} was recorded, the raw bytes do not give it"


def expected_of(folder: Path) -> Expected:
    """From every MCAP file of a run, unfinished ones too. Raises FileError for a damaged one."""
    expected = Expected()
    paths = sorted(path for place in ("windows", "rejected") for path in (folder / place).glob("*.mcap*"))
    expected.windows = tuple(path.relative_to(folder).as_posix() for path in paths)
    for path, name in zip(paths, expected.windows, strict=True):
        for message in read_mcap(path).messages:
            value = message.value
            if message.schema == ROW and not math.isnan(value.host_time):
                place = _Place(name, value.host_time, list(value.markers))
                expected.rows[value.device_frame, round(value.host_time * _MICRO)] = place
            elif message.schema == WINCH:
                key = value.cable - 1, round(value.host_time * _MICRO)
                expected.samples[key] = _Place(name, value.host_time, value)
    expected.syncs = tuple(sorted({place.t for place in expected.samples.values()}))
    return expected


def _taken(table: dict[tuple[int, int], _Place], which: int, t: float) -> _Place | None:
    """Take a value off by its key; one half way between two µs may have been rounded to either."""
    key = round(t * _MICRO)
    places = (table.pop((which, near), None) for near in (key, key - 1, key + 1))
    return next((place for place in places if place is not None), None)


def _same(was: float, now: float) -> bool:
    return (math.isnan(was) and math.isnan(now)) or abs(was - now) <= _TOLERANCE
