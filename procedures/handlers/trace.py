"""Short histories: what markers and winches did during the last moments."""

import re
from collections import deque
from collections.abc import Callable

import numpy as np

from drivers.ports import MarkerFrame, WinchSample
from fidim_lab.arrays import PerCable, Vector3
from procedures.stand import Stand
from procedures.timing import POLL

ENOUGH = 0.5
"""part of the frames that must have come for a look back to be believed (frames between two polls go unseen)"""

_LOAD_CELL = re.compile(r"f[1-9]\d*")


class MarkerTrace:
    """The main marker's positions during the last `over` seconds."""

    def __init__(self, rate: float, over: float) -> None:
        self._over = over
        self._enough = ENOUGH * over * min(rate, 1.0 / POLL)
        self._number = -1
        self._last: tuple[float, float, float] | None = None
        self._seen: deque[tuple[float, tuple[float, float, float]]] = deque()
        self._begin: float | None = None
        self._now = 0.0

    def take(self, frame: MarkerFrame | None, now: float) -> None:
        """Look at the newest frame; one seen before, without the marker, or with it frozen in its place adds nothing.

        A sensor has noise: exactly the same position again is no sign of rest.
        """
        self._begin = now if self._begin is None else self._begin
        if frame is not None and frame.number != self._number:
            self._number = frame.number
            if frame.main is not None and frame.main != self._last:
                self._seen.append((now, frame.main))
            self._last = frame.main
        while self._seen and self._seen[0][0] < now - self._over:
            self._seen.popleft()
        self._now = now

    @property
    def full(self) -> bool:
        """Whether enough was seen for all of the time."""
        return self._begin is not None and self._now - self._begin >= self._over and len(self._seen) >= self._enough

    @property
    def spread(self) -> float:
        """Peak to peak of the coordinate that moves most, m; 0 when nothing was seen."""
        return float(np.ptp(self._places, axis=0).max()) if self._seen else 0.0

    @property
    def mean(self) -> Vector3:
        """Mean position, m."""
        return self._places.mean(axis=0)

    @property
    def _places(self) -> np.ndarray:
        return np.array([place for _, place in self._seen])


async def winch_means(stand: Stand, over: float, value: Callable[[WinchSample], float]) -> PerCable:
    """The mean of one quantity of every winch over some seconds. Raises DeviceError when one stops reporting."""
    clock = stand.rig.clock
    begin = clock.now()
    taken: list[list[float]] = []
    while True:
        taken.append([value(sample) for sample in stand.samples()])
        passed = clock.now() - begin
        if passed >= over:
            return np.mean(taken, axis=0)
        stand.progress(passed / over)
        await clock.sleep(POLL)


async def load_cell_means(stand: Stand, over: float) -> dict[int, tuple[float, float]]:
    """Mean reading and uncertainty (N) of each cable's load cell over some seconds, by cable from 1.

    A cable whose load cell is silent for a part of them has none.
    """
    clock, cells = stand.rig.clock, [gauge for gauge in stand.rig.gauges if _LOAD_CELL.fullmatch(gauge.columns[0])]
    taken: dict[int, list[float]] = {int(column[1:]): [] for gauge in cells for column in gauge.columns}
    spread = {int(column[1:]): gauge.uncertainty for gauge in cells for column in gauge.columns}
    begin, looks = clock.now(), 0
    while cells and clock.now() - begin < over:
        looks += 1
        for gauge in cells:
            reading = gauge.latest()
            if reading is not None and clock.now() - reading.t <= gauge.age:
                for column, value in zip(gauge.columns, reading.values, strict=True):
                    taken[int(column[1:])].append(value)
        await clock.sleep(POLL)
    return {
        cable: (float(np.mean(values)), spread[cable])
        for cable, values in taken.items()
        if values and len(values) == looks
    }
