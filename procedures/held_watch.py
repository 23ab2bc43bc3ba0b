"""After a run: each encoder is still compared with the place where its winch was proven to stand.

A brake that slips, a drive that another program moves, a drum that a hand turns: the person at the robot believes the
run's last sentence. So it is looked at as long as this process lives, and a winch that moves is stopped as in a run.
"""

from collections.abc import Callable, Sequence
from pathlib import Path

from drivers.ports import Clock, Winch
from drivers.trajectory import Trajectory
from procedures.guards.motion_guard import Follower, Tolerance
from procedures.outcomes import Outcome
from procedures.recording.journal import Journal, LineKind, WallTime
from procedures.settings import Settings
from procedures.stopping import StoppedWinch
from procedures.teardown import Held, hold_robot


async def watch_held(
    clock: Clock,
    winches: Sequence[Winch],
    stopped: Sequence[StoppedWinch],
    settings: Settings,
    moved: Callable[[str, Held], None],
) -> None:
    """Look for ever at winches that have stopped; ends only when one did not obey, or cannot be seen any more.

    moved: told what moved, and what came of the stop that was then given.
    """
    contradicted = {winch.name for winch in winches if (sample := winch.latest()) is not None and sample.blind}
    while stopped and all(one.obeyed for one in stopped):
        says = await _one_moves(clock, winches, stopped, settings, contradicted)
        held = await hold_robot(clock, winches, settings.hold, settings.guard, latched=True)
        moved(f"After the stop, {says}.", held)
        stopped = held.winches


async def _one_moves(
    clock: Clock,
    winches: Sequence[Winch],
    stopped: Sequence[StoppedWinch],
    settings: Settings,
    contradicted: set[str],
) -> str:
    """Wait until one does, or until its encoder is contradicted, which then shows nothing; what is wrong with it.

    contradicted: those of whom that has been told.
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
        await clock.sleep(settings.guard.period)


def write_moved(journal: Path, clock: Clock, wall_time: WallTime, says: str, held: Held) -> None:
    """Into the journal of the run that had ended. Raises HardwareError."""
    with Journal(journal, clock, wall_time) as lines:
        lines.write(LineKind.TRIPPED, outcome=Outcome.ERROR, reason=says, data={"guard": "motion"})
        data = {"winches": [one.values for one in held.winches]}
        lines.write(LineKind.HELD, outcome=Outcome.PASS if held.ok else Outcome.ERROR, reason=held.says, data=data)
