"""Reading a procedure without hardware: its steps, how long they take, and the list to print.

Every step is answered by what it expects, so what is read is the run in which everything goes well.
"""

from collections.abc import Iterator, Mapping
from types import MappingProxyType

from procedures.outcomes import Outcome
from procedures.steps import Accept, GiveUp, Procedure, Step, Stop


def planned_steps(procedure: Procedure) -> Iterator[Step]:
    """The steps of the run in which everything goes well."""
    steps = procedure()
    try:
        step = next(steps)
        while True:
            yield step
            step = steps.send(step.expected)
    except StopIteration:
        return
    finally:
        steps.close()


class Outline:
    """The planned steps, and how much is left after each: for listing and progress."""

    def __init__(self, procedure: Procedure) -> None:
        self.steps = tuple(planned_steps(procedure))
        self.seconds = sum(step.seconds for step in self.steps)
        least, most = zip(*(step.seconds_between for step in self.steps), strict=True) if self.steps else ((), ())
        self.between = (sum(least), sum(most))
        """s: every rest and place at once, and none in time; a window that is recorded again comes on top"""
        self.windows = tuple(dict.fromkeys(step.window for step in self.steps if step.window))
        self._left: dict[tuple[object, ...], Mapping[type[Step], float]] = {}
        left: dict[type[Step], float] = {}
        for step in reversed(self.steps):
            left[type(step)] = left.get(type(step), 0.0) + step.seconds
            self._left[step.place] = MappingProxyType(left.copy())

    @property
    def without_verdict(self) -> tuple[str, ...]:
        """Windows that steps belong to and that get no verdict; none where the procedure stops by itself."""
        if self.steps and isinstance(self.steps[-1], Stop):
            return ()
        judged = {step.window for step in self.steps if isinstance(step, Accept | GiveUp)}
        return tuple(window for window in self.windows if window not in judged)

    def left_from(self, step: Step) -> Mapping[type[Step], float] | None:
        """Estimated s from a step's begin to the end, by type; None for a step that no plan has (a prompt again)."""
        return self._left.get(step.place)

    def text(self) -> str:
        """The numbered list, one line a step, with estimated time since the start."""
        lines: list[str] = []
        passed = 0.0
        for number, step in enumerate(self.steps, start=1):
            where = f"[{step.window}] " if step.window else ""
            lines.append(f"{number:4d}  {clock(passed)}  {where}{step.text}")
            passed += step.seconds
        lines.append(f"      {clock(passed)}  end: {self._reached()}, all winches held")
        lines.append(f"      {duration(*self.between)}")
        return "\n".join(lines) + "\n"

    def _reached(self) -> str:
        """How many windows the run comes to; those that are known to be given up are named."""
        lost = dict.fromkeys(
            step.window for step in self.steps if isinstance(step, GiveUp) and step.outcome is not Outcome.PASS
        )
        if not lost:
            return f"{len(self.windows)} windows"
        return f"{len(self.windows) - len(lost)} of {len(self.windows)} windows, without {', '.join(lost)} (see there)"


def duration(least: float, most: float) -> str:
    """How long a run takes, s, in words: a range where there is one."""
    if clock(least) == clock(most):
        return f"takes about {clock(least)}"
    rest = "depending on how soon the platform rests; repeated recordings take extra time"
    return f"takes {clock(least)} to {clock(most)}, {rest}"


def clock(seconds: float) -> str:
    """h:mm:ss"""
    minutes, rest = divmod(round(max(seconds, 0.0)), 60)
    return f"{minutes // 60}:{minutes % 60:02d}:{rest:02d}"
