"""Guards: what must never happen during a run, checked in every cycle independently of the procedure.

A guard is told what is seen and says, in a sentence, what is wrong, or nothing. Threshold, hysteresis, duration and age
are its own; an old value counts as a violation. The first trip ends the run: `watch` returns it, the engine latches it.
The guards themselves are in the files beside this one.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol, Self

from drivers.ports import Clock, MarkerFrame, WinchSample
from drivers.trajectory import Trajectory
from procedures.settings import GuardSettings, Reaction
from procedures.steps import Phase


@dataclass(frozen=True)
class Trip:
    """A guard has tripped."""

    t: float
    guard: str
    says: str
    """what was found and what is allowed, for a person"""
    reaction: Reaction


@dataclass(frozen=True)
class Observation:
    """The state of the run at one instant."""

    t: float
    phase: Phase
    winches: tuple[WinchSample | None, ...]
    frame: MarkerFrame | None
    commanded: tuple[Trajectory | None, ...] = ()
    """where each winch was told to be"""


class Guard(Protocol):
    """One thing that must not happen."""

    @property
    def name(self) -> str:
        """For the journal."""
        ...

    @property
    def reaction(self) -> Reaction:
        """The reaction to its trip."""
        ...

    def look(self, seen: Observation) -> str | None:
        """The violation in words, or None."""
        ...


@dataclass(frozen=True)
class Reacting:
    """A guard with another reaction than its own."""

    guard: Guard
    reaction: Reaction

    @classmethod
    def by(cls, settings: GuardSettings, guard: Guard) -> Self:
        """With the reaction that the settings say, else the guard's own."""
        return cls(guard, settings.reactions.get(guard.name, guard.reaction))

    @property
    def name(self) -> str:
        """The guard's."""
        return self.guard.name

    def look(self, seen: Observation) -> str | None:
        """As the guard."""
        return self.guard.look(seen)


HOST_LOOP = "host loop"
"""the guard whose own matter a standstill is"""


class Standstill:
    """Marks what guards find just after this computer stood still as a consequence of that.

    Drives that hear nothing of their host stop by themselves, samples grow old, and a winch is not where the command
    has it by now: which guard sees which of these first is chance.
    """

    def __init__(self, allowed: float) -> None:
        """allowed: s between two looks."""
        self._allowed = allowed
        self._before: float | None = None
        self._lasted, self._end = 0.0, 0.0

    def look(self, t: float) -> None:
        """Take the time of a look."""
        before, self._before = self._before, t
        if before is not None and t - before > self._allowed:
            self._lasted, self._end = t - before, t

    def cause(self, t: float, guard: str, says: str) -> str:
        """A guard's message with its cause: a standstill is the cause for as long again as it lasted."""
        ago = t - self._end
        if ago > self._lasted or not self._lasted or guard == HOST_LOOP:
            return says
        until = "" if ago < 0.005 else f", until {ago:.2f} s ago"
        return f"this computer stood still for {self._lasted:.2f} s{until}; {says}"


class Always(Reacting):
    """A guard that looks as long as any winch has power, while others are still being given it, too."""


_NOT_ENABLED = (Phase.PREPARING, Phase.WITHOUT_POWER, Phase.TRYING, Phase.TAKING_UP)
"""in which not every drive is expected to be enabled: only what looks always does"""


async def watch(
    clock: Clock,
    guards: Sequence[Guard],
    look: Callable[[], Observation],
    settings: GuardSettings,
    react: Callable[[Trip], None],
) -> Trip:
    """Look in every cycle until a guard trips; `react` is called in that same cycle. Returns the trip.

    A trip just after this computer has stood still for longer than samples are believed, or than its drives allow, says
    that first.

    A guard that only warns is told of once, and again when it has been content meanwhile. One that rejects a window is
    told of in every cycle; neither ends the watch.
    """
    warned: set[str] = set()
    standstill = Standstill(min(settings.sample_age, settings.loop_late))
    while True:
        seen = look()
        standstill.look(seen.t)
        for guard in guards:
            if seen.phase in _NOT_ENABLED and not isinstance(guard, Always):
                continue
            says = guard.look(seen)
            if says is None:
                warned.discard(guard.name)
                continue
            trip = Trip(seen.t, guard.name, standstill.cause(seen.t, guard.name, says), guard.reaction)
            if trip.reaction is Reaction.REJECT_WINDOW:
                react(trip)  # each time: the violation may have begun before the recording
                continue
            if trip.reaction is not Reaction.WARN:
                react(trip)
                return trip
            if guard.name not in warned:
                warned.add(guard.name)
                react(trip)
        await clock.sleep(settings.period)
