"""One combination carried out in the jumping-clock world, and what came of it."""

import signal
import tempfile
import traceback
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.rehearsal import TWO, Ended, Rehearsal, short
from benchmarks.safety import judge
from benchmarks.safety.draw import Combination, Planted, combination
from benchmarks.safety.judge import Violation
from benchmarks.safety.witness import TURNS, Truth, Witness
from fidim_lab.app import compose
from fidim_lab.data.robot_file import PAPERS_ROBOT, read_robot
from fidim_lab.errors import FidimError
from procedures.events import RunFinished, StepStarted, Tripped, Warned

LONGEST = 300.0
"""s that a run may take by its clock; one without faults takes 20"""
HANGS = 900
"""s by the wall in which nothing comes to an end: the program hangs"""


@dataclass(frozen=True)
class Outcome:
    """One run, judged."""

    number: int
    faults: tuple[str, ...]
    kinds: tuple[str, ...]
    ended: str
    """pass, error …, or refused before anything moved"""
    reason: str
    held: str
    guard: str
    accepted: tuple[str, ...]
    tension: tuple[float, float]
    """N, smallest and largest true one"""
    used: float
    """part of the room beyond the limits"""
    violations: tuple[Violation, ...]
    story: tuple[str, ...]
    """what happened when"""

    @property
    def worst(self) -> tuple[int, float]:
        """For sorting."""
        return len(self.violations), max([v.size for v in self.violations], default=self.used)


class Hang(BaseException):
    """The alarm rang."""


def one_run(seed: int, number: int) -> Outcome:
    """Carry out combination `number` of a seed, and judge it."""
    return carry_out(combination(seed, number))


def carry_out(plan: Combination) -> Outcome:
    """Never raises for what the product does."""
    with tempfile.TemporaryDirectory(prefix="fidim-safety-") as folder:
        rehearsal, witness = _prepared(plan, Path(folder) / "run")
        broken: list[Violation] = []
        ended: Ended | None = None
        refusal = ""
        try:
            with _alarm():
                ended = rehearsal.run()
        except FidimError as error:
            refusal = str(error)
        except TimeoutError:
            broken.append(Violation("c: no end", f"goes on after {LONGEST:g} s", 1.0))
        except Hang:
            broken.append(Violation("c: hang", f"nothing happened for {HANGS} s", 1.0))
        except Exception as error:
            where = traceback.extract_tb(error.__traceback__)[-1]
            says = f"{type(error).__name__}: {error} ({Path(where.filename).name}:{where.lineno})"
            broken.append(Violation("c: traceback", says, 1.0))
        outcome = _judged(plan, rehearsal, witness, ended, refusal, broken)
        return _without(outcome, f"{folder}/")


def _without(outcome: Outcome, folder: str) -> Outcome:
    """The same each time, wherever it was written."""
    story = tuple(line.replace(folder, "") for line in outcome.story)
    return replace(outcome, reason=outcome.reason.replace(folder, ""), story=story)


def _prepared(plan: Combination, folder: Path) -> tuple[Rehearsal, Witness]:
    rehearsal, witness = Rehearsal(read_robot(PAPERS_ROBOT), folder), Witness()
    settings = short(repeats=1)
    rehearsal.plan = TWO
    rehearsal.settings = replace(settings, motion=replace(settings.motion, speed=plan.speed))
    rehearsal.deadline = LONGEST
    rehearsal.at("", witness.attach)
    for one in plan.planted:
        rehearsal.at(one.step.value, one.fault.strike, after=one.after, nth=one.nth)
    return rehearsal, witness


def _judged(
    plan: Combination,
    rehearsal: Rehearsal,
    witness: Witness,
    ended: Ended | None,
    refusal: str,
    broken: list[Violation],
) -> Outcome:
    truth = witness.truth()
    limits = rehearsal.robot.limits.tension
    times = [] if ended is None else ended.planted[1:]  # the first is the witness
    struck = _struck(plan, ended)
    since = min(times, default=truth.t[0])
    at = max(truth.since(since).start - 1, 0)
    allowed = judge.room(witness.stiffness(truth.lengths[at]), struck, truth, since)
    used, beyond = judge.tension(truth, limits, allowed)
    broken += beyond
    report = None
    if ended is not None and ended.events and isinstance(ended.events[-1], RunFinished):
        report = ended.report
        broken += judge.sentences(ended, truth, witness.place)
        if "bug" in report.reason:
            broken.append(Violation("c: bug", report.reason, 1.0))
    elif not refusal and not broken:
        broken.append(Violation("c: no report", "the run ended without one", 1.0))
    trip = ended.trip if ended is not None else None
    return Outcome(
        number=plan.number,
        faults=tuple(one.text for one in plan.planted),
        kinds=tuple(one.kind for one in plan.planted),
        ended=report.outcome.value if report else "refused" if refusal else "broken off",
        reason=report.reason if report else refusal,
        held=report.held_says if report else "",
        guard=trip.guard if trip else "",
        accepted=tuple(row.id for row in report.accepted) if report else (),
        tension=(float(truth.tensions.min()), float(truth.tensions.max())),
        used=used,
        violations=tuple(broken),
        story=tuple(_story(truth, ended, struck, times, allowed)) if ended is not None else (),
    )


def _struck(plan: Combination, ended: Ended | None) -> tuple[Planted, ...]:
    """The faults that came before the end: those whose step had begun for long enough."""
    if ended is None:
        return plan.planted
    last = ended.events[-1].t if ended.events else np.inf
    came: list[Planted] = []
    for one in plan.planted:
        begun = ended.begun.get(one.step.value, [])
        if not one.step or (len(begun) >= one.nth and begun[one.nth - 1] + one.after <= last):
            came.append(one)
    return tuple(came)


def _story(
    truth: Truth, ended: Ended, struck: tuple[Planted, ...], times: list[float], allowed: judge.Room
) -> list[str]:
    """What happened when, by the host's clock."""
    told: list[tuple[float, str]] = [(t, "a fault comes") for t in times]
    for one in struck:
        begun = ended.begun.get(one.step.value, [0.0])
        told.append((begun[one.nth - 1] + one.after, one.fault.says))
    for event in ended.events:
        match event:
            case StepStarted():
                told.append((event.t, f"step “{event.step.text}” {event.step.window or ''}".rstrip()))
            case Tripped():
                told.append((event.t, f"the {event.trip.guard} guard trips ({event.trip.reaction}): {event.trip.says}"))
            case Warned():
                told.append((event.t, f"warning: {event.trip.says}"))
            case RunFinished():
                report = event.report
                told.append((event.t, f"the run ends ({report.outcome}): {report.reason} {report.held_says}"))
            case _:
                pass
    told = [entry for entry in told if entry[1] != "a fault comes"]
    first = min(times, default=0.0)
    for k in range(truth.tensions.shape[1]):
        turning = truth.t[(np.abs(truth.speeds[:, k]) > TURNS) & (truth.t >= first)]
        if len(turning):
            after = truth.lengths[truth.since(first), k]
            says = (
                f"winch {k + 1} turned for the last time; {1e3 * (after[-1] - after[0]):+.1f} mm since the first fault"
            )
            told.append((float(turning[-1]), says))
    lines = [f"{t:8.3f} s  {says}" for t, says in sorted(told)]
    ways = ", ".join(f"{1e3 * d:.0f}" for d in allowed.distances)
    newton = ", ".join(f"{n:.1f}" for n in allowed.newton)
    return [*lines, f"room beyond the limits: {newton} N (lone ways of the cables: {ways} mm)"]


@contextmanager
def _alarm() -> Generator[None]:
    """Ring when nothing comes to an end; a signal that the product does not hear any more ends no series of runs."""

    def ring(_number: int, _frame: object) -> None:
        raise Hang

    def ignore(_number: int, _frame: object) -> None:
        pass

    handlers = {signal.SIGALRM: ring, **dict.fromkeys(compose.STOP_SIGNALS, ignore)}
    before = {number: signal.signal(number, handler) for number, handler in handlers.items()}
    signal.alarm(HANGS)
    try:
        yield
    finally:
        signal.alarm(0)
        for number, handler in before.items():
            signal.signal(number, handler)
