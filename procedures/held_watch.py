"""After a run: each encoder is still compared with the place where its winch was proven to stand.

A brake that slips, a drive that another program moves, a drum that a hand turns: the person at the robot believes the
run's last sentence. So it is looked at as long as this process lives, and a winch that moves is stopped as in a run. A
winch that loses its motor power, or is not seen any more, is told: its last sentence has said that it is held.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from drivers.ports import Clock, DriveState, Winch
from drivers.trajectory import Trajectory
from procedures.guards.motion_guard import Follower, Tolerance
from procedures.outcomes import Outcome
from procedures.recording.journal import Journal, LineKind, WallTime
from procedures.settings import Settings
from procedures.stopping import POWERED, StoppedWinch
from procedures.teardown import Held, hold_robot


async def watch_held(
    clock: Clock,
    winches: Sequence[Winch],
    stopped: Sequence[StoppedWinch],
    settings: Settings,
    moved: Callable[[str, Held], None],
    lost: Callable[[str], None],
) -> None:
    """Look for ever at winches that have stopped; ends only when one did not obey.

    moved: told what moved, and what came of the stop that was then given; lost: told who has no motor power any more,
    or is not seen. Neither is stopped for it: there is nothing to stop, and people switch a robot off after a run.
    """
    losses = _Losses(winches, settings.guard.sample_age)
    contradicted = {winch.name for winch in winches if (sample := winch.latest()) is not None and sample.blind}
    while stopped and all(one.obeyed for one in stopped):
        says = await _one_moves(clock, winches, stopped, settings, contradicted, lambda now: losses.look(now, lost))
        held = await hold_robot(clock, winches, settings.hold, settings.guard, latched=True)
        moved(f"After the stop, {says}.", held)
        stopped = held.winches


async def _one_moves(
    clock: Clock,
    winches: Sequence[Winch],
    stopped: Sequence[StoppedWinch],
    settings: Settings,
    contradicted: set[str],
    besides: Callable[[float], None],
) -> str:
    """Wait until one does, or until its encoder is contradicted, which then shows nothing; what is wrong with it.

    contradicted: those of whom that has been told. besides: done each time, at monotonic s.
    """
    tolerance = Tolerance.of(settings.guard)
    places = [None if one.place is None else Trajectory.standing(clock.now(), one.place) for one in stopped]
    followers = [Follower(tolerance) for _ in winches]
    while True:
        for winch, follower, place in zip(winches, followers, places, strict=True):
            sample = winch.latest()
            if sample is not None and sample.blind and winch.name not in contradicted:
                contradicted.add(winch.name)
                return f"{winch.name} reports a fault: {sample.fault}"
            if says := follower.look(sample, place):
                return f"{winch.name} {says}"
        besides(clock.now())
        await clock.sleep(settings.guard.period)


@dataclass
class _Loss:
    """One thing that may be lost by each winch, and is told once."""

    lasts: float
    """s for which it must be so before it is told: together with the others, and not for one late frame"""
    since: dict[str, float] = field(default_factory=dict[str, float])
    told: set[str] = field(default_factory=set[str])

    def look(self, now: float, lost: Sequence[str]) -> list[str]:
        """Take who has lost it now; who is to be told."""
        self.since = {name: self.since.get(name, now) for name in lost}
        self.told &= set(lost)  # who has it again may lose it again
        new = [name for name in self.since if name not in self.told]
        if not any(now - self.since[name] >= self.lasts for name in new):
            return []
        self.told |= set(new)
        return new


class _Losses:
    """Motor power, and samples, of winches that were held when the run ended."""

    def __init__(self, winches: Sequence[Winch], age: float) -> None:
        self._winches = winches
        self._age = age
        self._power, self._sight = _Loss(age), _Loss(age)
        self._had_power = {w.name for w in winches if (s := w.latest()) is not None and s.state in POWERED}

    def look(self, now: float, tell: Callable[[str], None]) -> None:
        """Tell what has been lost since the last look."""
        samples = [(w.name, s) for w in self._winches if (s := w.latest()) is not None]
        unseen = [name for name, s in samples if now - s.t > self._age]
        states = {name: s.state for name, s in samples if s.state not in (*POWERED, DriveState.UNKNOWN)}
        if names := self._power.look(now, [n for n in states if n in self._had_power and n not in unseen]):
            why = "; ".join(dict.fromkeys(s.fault or s.state for n, s in samples if n in names))
            brakes = "brakes" if len(names) > 1 else "its brake"
            tell(f"After the stop, {_have(names)} lost motor power ({why}): only {brakes} can hold now.")
        if names := self._sight.look(now, unseen):
            age = max(now - s.t for n, s in samples if n in names)
            tell(
                f"After the stop, {_have(names)} not answered for {age:.1f} s: whether the robot is held is not known "
                "any more."
            )


def _have(names: Sequence[str]) -> str:
    return f"{', '.join(names)} {'have' if len(names) > 1 else 'has'}"


def write_lost(journal: Path, clock: Clock, wall_time: WallTime, says: str) -> None:
    """Into the journal of the run that had ended. Raises HardwareError."""
    with Journal(journal, clock, wall_time) as lines:
        lines.write(LineKind.WARNED, reason=says, data={"guard": "held"})


def write_moved(journal: Path, clock: Clock, wall_time: WallTime, says: str, held: Held) -> None:
    """Into the journal of the run that had ended. Raises HardwareError."""
    with Journal(journal, clock, wall_time) as lines:
        lines.write(LineKind.TRIPPED, outcome=Outcome.ERROR, reason=says, data={"guard": "motion"})
        data = {"winches": [one.values for one in held.winches]}
        lines.write(LineKind.HELD, outcome=Outcome.PASS if held.ok else Outcome.ERROR, reason=held.says, data=data)
