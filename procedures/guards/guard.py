"""Guards: what must never happen while a run goes on, looked at in every cycle beside the procedure.

A guard is told what is seen and says, in a sentence, what is wrong, or nothing. Threshold, hysteresis, duration and age
are its own; an old value counts as a violation. The first trip ends the run: `watch` returns it, the engine latches it.
The guards themselves are in `robot_guards`, `drive_guards` and `host_guards`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from drivers.ports import Clock, MarkerFrame, WinchSample
from drivers.trajectory import Trajectory
from procedures.settings import Reaction
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
    """What is known at one instant."""

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
        """What its trip does."""
        ...

    def look(self, seen: Observation) -> str | None:
        """What is wrong, or None."""
        ...


@dataclass(frozen=True)
class Reacting:
    """A guard with another reaction than its own."""

    guard: Guard
    reaction: Reaction

    @property
    def name(self) -> str:
        """The guard's."""
        return self.guard.name

    def look(self, seen: Observation) -> str | None:
        """As the guard."""
        return self.guard.look(seen)


class Always(Reacting):
    """A guard that looks as long as any winch has power, while others are still being given it, too."""


async def watch(
    clock: Clock, guards: Sequence[Guard], look: Callable[[], Observation], period: float, react: Callable[[Trip], None]
) -> Trip:
    """Look in every cycle until a guard trips; `react` is called in that same cycle. Returns the trip.

    A guard that only warns is told of once, and again when it has been content meanwhile. One that rejects a window is
    told of in every cycle; neither ends the watch.
    """
    warned: set[str] = set()
    while True:
        seen = look()
        for guard in guards:
            if seen.phase in (Phase.PREPARING, Phase.TRYING) and not isinstance(guard, Always):
                continue
            says = guard.look(seen)
            if says is None:
                warned.discard(guard.name)
                continue
            trip = Trip(seen.t, guard.name, says, guard.reaction)
            if trip.reaction is Reaction.REJECT_WINDOW:
                react(trip)  # each time: the violation may have begun before the recording
                continue
            if trip.reaction is not Reaction.WARN:
                react(trip)
                return trip
            if guard.name not in warned:
                warned.add(guard.name)
                react(trip)
        await clock.sleep(period)
