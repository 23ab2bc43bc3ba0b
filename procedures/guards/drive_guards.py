"""Guards on values that drives report: following error, temperature, lost bus cycles.

Faults, states, heartbeats and emergencies are `robot_guards.DriveGuard`'s matter: a drive that has one is not enabled.
"""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from drivers.ports import WinchSample
from procedures.guards.guard import Observation
from procedures.settings import GuardSettings, Reaction


@dataclass(frozen=True)
class _Threshold:
    """A value in its own unit: beyond `limit` it is a violation, which ends only `hysteresis` below."""

    limit: float
    hysteresis: float
    lasting: float
    """s"""


class _Above:
    """Which of several values have been above a threshold for too long; None is a value that nobody reports."""

    def __init__(self, threshold: _Threshold) -> None:
        self._threshold = threshold
        self._since: dict[int, float] = {}

    def look(self, t: float, values: Sequence[float | None]) -> int | None:
        """The first such."""
        limit = self._threshold
        for index, value in enumerate(values):
            if value is not None and value > limit.limit:
                self._since.setdefault(index, t)
            elif value is None or value <= limit.limit - limit.hysteresis:
                self._since.pop(index, None)
            if index in self._since and t - self._since[index] >= limit.lasting:
                return index
        return None


class FollowingErrorGuard:
    """A motor lags behind its demanded position, before the drive's own window (6065) makes it a fault."""

    name = "following error"
    reaction = Reaction.HOLD

    def __init__(self, winches: Sequence[str], settings: GuardSettings) -> None:
        self._winches = winches
        self._allowed = settings.following_error
        self._above = _Above(_Threshold(self._allowed, 0.2 * self._allowed, settings.following_error_for))

    def look(self, seen: Observation) -> str | None:
        """The first winch that stays behind."""
        values = [_reported(s, lambda s: s.following_error) for s in seen.winches]
        index = self._above.look(seen.t, [None if value is None else abs(value) for value in values])
        if index is None:
            return None
        return (
            f"{self._winches[index]} is {1e3 * (values[index] or 0.0):+.1f} mm from its drive's commanded position, "
            f"at most {1e3 * self._allowed:g} mm is allowed"
        )


class TemperatureGuard:
    """A drive gets hot; or it has told its temperature and does not any more."""

    name = "temperature"
    reaction = Reaction.HOLD

    def __init__(self, winches: Sequence[str], settings: GuardSettings) -> None:
        self._winches = winches
        self._allowed = settings.temperature
        self._above = _Above(_Threshold(self._allowed, settings.temperature_hysteresis, 0.0))
        self._age = settings.temperature_age
        self._told: dict[int, float] = {}
        """when each last told it"""

    def look(self, seen: Observation) -> str | None:
        """The first winch that is too hot, or silent about it."""
        values = [_reported(s, lambda s: s.temperature) for s in seen.winches]
        index = self._above.look(seen.t, values)
        if index is not None:
            return f"{self._winches[index]} has {values[index] or 0.0:.0f} °C, at most {self._allowed:g} °C is allowed"
        for index, value in enumerate(values):
            if value is not None:
                self._told[index] = seen.t
            elif seen.t - self._told.get(index, seen.t) > self._age:
                silent = seen.t - self._told[index]
                return f"{self._winches[index]} has not reported its temperature for {silent:.0f} s"
        return None


class BusGuard:
    """Bus cycles go missing: samples were lost within the last second. Silence is the staleness guard's matter."""

    name = "bus errors"
    reaction = Reaction.WARN
    SPAN = 1.0
    """s"""

    def __init__(self, winches: Sequence[str], allowed: int) -> None:
        self._winches = winches
        self._allowed = allowed
        self._counts: deque[tuple[float, tuple[int, ...]]] = deque()
        self._wrong = False

    def look(self, seen: Observation) -> str | None:
        """The winch that has lost most, where that is too much; content again below half of what is allowed."""
        now = tuple(0 if sample is None else sample.lost for sample in seen.winches)
        self._counts.append((seen.t, now))
        while seen.t - self._counts[0][0] > self.SPAN:
            self._counts.popleft()
        lost = [b - a for a, b in zip(self._counts[0][1], now, strict=True)]
        worst = max(range(len(lost)), key=lost.__getitem__, default=None)
        most = 0 if worst is None else lost[worst]
        self._wrong = most > self._allowed or (self._wrong and 2 * most > self._allowed)
        if worst is None or not self._wrong:
            return None
        return (
            f"{self._winches[worst]}: {most} bus cycles of the last second brought no sample, "
            f"at most {self._allowed} is allowed"
        )


def _reported(sample: WinchSample | None, pick: Callable[[WinchSample], float | None]) -> float | None:
    return None if sample is None else pick(sample)
