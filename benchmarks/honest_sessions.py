"""Sessions without a fault: whether a guard stops one, and how near the guards of slack and geometry come to it.

python -m benchmarks.honest_sessions --seeds 8                      # sessions of twelve equilibria, and their replays
python -m benchmarks.honest_sessions --robots 10                    # with robot files whose anchors are off
python -m benchmarks.honest_sessions --seeds 8 --robots 10 --page   # both, as sections of docs/benchmarks/safety.md

What the guards of a session have seen is kept, and shown to other guards afterwards: thresholds halved and doubled.
"""

import argparse
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar
from unittest.mock import patch

import numpy as np

from benchmarks.page import table, write_section
from benchmarks.rehearsal import Rehearsal, rehearsal, short
from fidim_lab.app import compose
from fidim_lab.data.records import Robot
from fidim_lab.data.robot_file import PAPERS_ROBOT, read_robot
from fidim_lab.errors import FidimError
from fidim_lab.identification.random_plan import WITHIN_LIMITS, random_plan
from procedures.expected import NominalRest
from procedures.guards import geometry_guard
from procedures.guards.geometry_guard import GeometryGuard, Place
from procedures.guards.guard import Guard, Observation
from procedures.guards.robot_guards import TensionGuard
from procedures.protocols import catalogue
from procedures.settings import Settings

WINDOWS = 12
SECONDS = 6.0
OFF = tuple(1e-3 * np.geomspace(2.0, 35.0, 10))
"""m by which every anchor of a robot file is off, each in its own direction"""
FACTORS = (0.5, 1.0, 2.0)
COMMAND = "python -m benchmarks.honest_sessions --seeds {} --robots {} --page"


@dataclass(frozen=True)
class Looked:
    """What the guards had before them in one cycle."""

    seen: Observation
    place: Place | None
    """where markers and lengths were compared last"""


@dataclass(frozen=True)
class Session:
    """One session that has ended."""

    accepted: int
    guard: str
    """that stopped it; empty without one"""
    reason: str
    looks: tuple[Looked, ...]


def session(seed: int, windows: int = WINDOWS, file: Callable[[Robot], Robot] = lambda robot: robot) -> Session:
    """One without a fault. file: what the robot file says of the robot."""
    robot, looks = read_robot(PAPERS_ROBOT), list[Looked]()
    told = file(robot)
    plan = random_plan(told, "honest", windows, 0, seed, WITHIN_LIMITS)
    with tempfile.TemporaryDirectory() as folder, patch.object(rehearsal, "STANDS", plan), _kept(looks):
        run = Rehearsal(robot, Path(folder) / "run")
        settings = short(seconds=SECONDS)
        run.seed, run.plan = seed, plan
        run.settings = replace(settings, motion=replace(settings.motion, length_limits=compose.length_limits(plan)))
        try:
            ended = run.run(catalogue.experiment("identify", plan, told, run.settings))
        except FidimError as error:
            return Session(0, "", error.message, tuple(looks))
    report = ended.report
    return Session(len(report.accepted), ended.trip.guard if ended.trip else "", report.reason, tuple(looks))


@contextmanager
def _kept(looks: list[Looked]) -> Iterator[None]:
    """Note what the geometry guard of a run is shown."""

    class Noting(GeometryGuard):
        def look(self, seen: Observation) -> str | None:
            looks.append(Looked(seen, self._last()))
            return super().look(seen)

    with patch.object(geometry_guard, "GeometryGuard", Noting):
        yield


class Measuring(GeometryGuard):
    """Notes the largest part of what is allowed."""

    part = 0.0

    def _off(self, *given: np.ndarray) -> np.ndarray:
        off = super()._off(*given)
        self.part = max(self.part, float(np.linalg.norm(off)) / self._allowed(given[1]))
        return off


Made = TypeVar("Made", bound=Guard)


def replayed(looks: tuple[Looked, ...], made: Callable[[Callable[[], Place | None]], Made]) -> tuple[str, Made]:
    """What a guard says first of a session; empty where it says nothing."""
    places = [None if not looks else looks[0].place]
    guard = made(lambda: places[0])
    for one in looks:
        places[0] = one.place
        if says := guard.look(one.seen):
            return says, guard
    return "", guard


def geometry(robot: Robot, settings: Settings) -> Callable[[Callable[[], Place | None]], Measuring]:
    """The geometry guard of a robot file."""
    rest, factors = NominalRest(robot), _factors(robot)
    return lambda place: Measuring(robot, place, rest.pose, settings, factors, str)


def slack(robot: Robot, settings: Settings) -> Callable[[object], Guard]:
    """The tension guard."""
    return lambda _: TensionGuard(_factors(robot), robot.limits.tension, settings.guard)


def _factors(robot: Robot) -> tuple[float, ...]:
    return tuple(winch.newton_per_ampere for winch in robot.winches or ())


def displaced(robot: Robot, by: float, seed: int) -> Robot:
    """A robot file whose anchors are off, m."""
    ways = np.random.default_rng(seed).normal(size=(robot.n, 3))
    ways *= by / np.linalg.norm(ways, axis=1, keepdims=True)
    return replace(
        robot, cables=tuple(replace(one, d=one.d + way) for one, way in zip(robot.cables, ways, strict=True))
    )


def honest(seeds: int) -> str:
    """Sessions and their replays with thresholds halved and doubled."""
    robot, stopped, sessions = read_robot(PAPERS_ROBOT), dict[str, int](), list[str]()
    parts: list[float] = []
    for seed in range(1, seeds + 1):
        found = session(seed)
        print(f"seed {seed}: {found.accepted} windows accepted, guard {found.guard or '–'}", flush=True)
        sessions += [found.guard] * bool(found.guard)
        for factor in FACTORS:
            usual = Settings()
            allowed = _with(usual, geometry=factor * usual.guard.geometry)
            says, guard = replayed(found.looks, geometry(robot, allowed))
            parts += [guard.part] * (factor == 1.0)
            handled = _with(usual, slack_handled=factor * usual.guard.slack_handled)
            told = {"geometry.allowed": says, "tension.handled": replayed(found.looks, slack(robot, handled))[0]}
            for key, words in ((f"{name} × {factor:g}", words) for name, words in told.items()):
                stopped[key] = stopped.get(key, 0) + bool(words)
                print(*[f"  {key}: {words}"] * bool(words), sep="\n", end="\n" * bool(words), flush=True)
    rows = [[key, f"{count}/{seeds}"] for key, count in stopped.items()]
    return (
        f"{seeds} sessions of {WINDOWS} windows: {len(sessions)} stopped by a guard. The geometry guard's error was at "
        f"most {max(parts):.2f} of what it allows.\n\n" + table(["threshold", "sessions that a replay stops"], rows)
    )


def _with(settings: Settings, **guard: float) -> Settings:
    return replace(settings, guard=replace(settings.guard, **guard))


def wrong_files(count: int) -> str:
    """Sessions with robot files whose anchors are off."""
    rows: list[list[object]] = []
    for seed, by in enumerate(OFF[:count], start=1):
        found = session(seed, WINDOWS // 2, lambda robot, by=by, seed=seed: displaced(robot, by, seed))
        file = displaced(read_robot(PAPERS_ROBOT), by, seed)
        _, measured = replayed(found.looks, geometry(file, Settings()))
        ended = found.reason.split(". All winches")[0]
        rows.append([f"{1e3 * by:.1f}", found.accepted, found.guard or "–", f"{measured.part:.2f}", ended[:160]])
        print(*rows[-1], sep=" | ", flush=True)
    return table(["anchors off, mm", "windows of 6", "guard", "part of what geometry allows", "end"], rows)


def main() -> None:
    """Carry out and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=0)
    parser.add_argument("--robots", type=int, default=0, choices=range(len(OFF) + 1))
    parser.add_argument("--page", action="store_true")
    chosen = parser.parse_args()
    command = COMMAND.format(chosen.seeds, chosen.robots)
    asked = {
        "Honest sessions, and thresholds halved and doubled": honest(chosen.seeds) if chosen.seeds else "",
        "Honest sessions with a wrong robot file": wrong_files(chosen.robots) if chosen.robots else "",
    }
    for title, text in asked.items():
        if text:
            print(text)
        if text and chosen.page:
            write_section("safety", title, command, text)


if __name__ == "__main__":
    main()
