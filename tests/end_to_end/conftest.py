"""A rehearsal for fault tests: the real drivers on simulated drives and cameras, with faults planted at steps.

Everything passes as protocol bytes. Whatever was planted, `Ended.check` looks at what must always hold: shafts at rest
and staying there, journal and campaign readable, every frame that came during a recording in a file, a whole CAN log.
"""

import asyncio
import math
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drivers.canbus.candump import CandumpLog, read_candump
from drivers.canbus.transport import CanFrame
from drivers.ports import MarkerFrame
from fidim_lab.app import compose
from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.mcap_file import read_mcap
from fidim_lab.data.records import Plan, PlannedWindow, Robot, Role
from fidim_lab.errors import FidimError
from procedures import catalogue
from procedures.events import Event, RunFinished, StepStarted, Tripped
from procedures.experiment import Experiment
from procedures.guards import Trip
from procedures.journal import Entry, Kind, read_journal
from procedures.outcomes import Outcome
from procedures.report import RunReport
from procedures.robot_guards import LogGuard
from procedures.run import run_procedure
from procedures.settings import HandSettings, MotionSettings, RecordSettings, Settings, TensionSettings
from procedures.timing import uninterrupted
from sim_backends.drive.machine import State
from sim_backends.drive.node import SimulatedDrive
from sim_backends.laboratory import Laboratory
from sim_backends.mocap.faults import During, Faults, Freeze, Jump, Occlusion

RATE = compose.MARKER_RATE
AFTERWARDS = 1.0
"""s for which the world lives on after a run, to see that nothing moves any more"""
ROUNDING = 1e-5
"""m in a window file"""
SAFE = {State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE, State.FAULT, State.SWITCH_ON_DISABLED, State.READY}
"""powered and standing, or braked"""


def planned(id_: str, lengths: Sequence[float], position: tuple[float, float, float]) -> PlannedWindow:
    return PlannedWindow(id_, Role.IDENTIFY, np.array(lengths), np.array([-0.02, 0.03]), np.array(position))


START = planned("s", (1.34283, 1.43119, 1.56772, 1.45231), (1.109, -0.273, -0.405))
FIRST = planned("i01", (1.30283, 1.39119, 1.52772, 1.41231), (1.111, -0.271, -0.315))
SECOND = planned("i02", (1.36283, 1.37119, 1.49772, 1.46231), (1.175, -0.260, -0.352))
ONE, TWO = Plan("one window", (FIRST,)), Plan("two windows", (FIRST, SECOND))
STANDS = Plan("where the robot stands", (START, FIRST, SECOND))
"""the simulated robot rests at the first one's lengths, so that the first step is a move"""


def short(**recording: Any) -> Settings:
    """A protocol of nine seconds a window."""
    return Settings(
        motion=MotionSettings(settle_over=0.3, length_limits=compose.length_limits(STANDS)),
        tension=TensionSettings(over=0.2),
        hand=HandSettings(over=0.3, timeout=2.0),
        record=RecordSettings(**{"seconds": 1.5, **recording}),
    )


class MocapFaults:
    """Adds faults to a stream while it runs."""

    def __init__(self, faults: Faults | None) -> None:
        self._added: dict[str, list[Any]] = {"occlusions": [], "freezes": [], "silences": [], "strays": [], "jumps": []}
        self.faults = replace(faults or Faults(), **self._added)
        self.now: Callable[[], float] = lambda: 0.0
        self.begin = 0.0

    def add(self, kind: str, seconds: float, *more: Any) -> None:
        """From now on: "occlusions", "freezes", "silences", "strays", or "jumps" with an offset."""
        since = self.now() - self.begin - 1.0 / RATE  # a stream begins one period after its server
        during = During(since, since + seconds)
        makes = {"occlusions": Occlusion, "freezes": Freeze, "silences": _itself, "strays": _itself, "jumps": Jump}
        self._added[kind].append(makes[kind](during, *more))


def _itself(during: During) -> During:
    return during


@dataclass(frozen=True, eq=False)
class Stage:
    """What a fault may break."""

    rig: compose.SimulatedRig
    robot: Robot
    now: Callable[[], float]
    mocap: MocapFaults
    tasks: "list[asyncio.Future[Any]]" = field(default_factory=list)
    """of faults that take their time; ended with the run"""

    @property
    def bus(self) -> Any:
        return self.rig.transport

    def drive(self, cable: int) -> SimulatedDrive:
        return self.rig.drives[cable - 1]

    def add_tension(self, cable: int, newton: float) -> None:
        """As the ammeter of a drive tells it."""
        winches = self.robot.winches
        assert winches is not None
        pull = -self.rig.laboratory.drums[cable - 1].direction
        self.drive(cable).faults.offset_current(pull * newton / winches[cable - 1].newton_per_ampere)

    def end_task(self, name: str) -> None:
        """End a background task of the host by the name of its coroutine."""
        (task,) = [t for t in asyncio.all_tasks() if getattr(t.get_coro(), "__qualname__", "") == name]
        task.cancel()


@dataclass(frozen=True, eq=False)
class Ended:
    """A run that has ended, and all that was seen from outside."""

    folder: Path
    rows: int
    """of a whole window"""
    events: list[Event] = field(default_factory=list)
    frames: list[CanFrame] = field(default_factory=list)
    """as they passed the master's adapter"""
    markers: dict[int, MarkerFrame] = field(default_factory=dict)
    """every marker frame that the source handed out, by number"""
    truth: dict[int, np.ndarray] = field(default_factory=dict)
    """where the main marker truly was in each frame"""
    planted: list[float] = field(default_factory=list)
    """when each fault came"""
    begun: dict[str, list[float]] = field(default_factory=dict)
    """when steps began, by type"""
    drives: tuple[SimulatedDrive, ...] = ()
    rest: tuple[float, ...] = ()
    """position of each shaft when the run ended, counts"""
    shafts: tuple[tuple[float, float], ...] = ()
    """position and speed a while later"""
    error: BaseException | None = None

    @property
    def report(self) -> RunReport:
        last = self.events[-1]
        assert isinstance(last, RunFinished)
        return last.report

    @property
    def trip(self) -> Trip | None:
        return next((e.trip for e in self.events if isinstance(e, Tripped)), None)

    @property
    def journal(self) -> tuple[Entry, ...]:
        return read_journal(self.folder / "journal.jsonl")

    def controlwords(self, since: float = -math.inf) -> list[tuple[float, int, int]]:
        """(time, node, word) of every controlword since a time, by RPDO or by SDO."""
        found: list[tuple[float, int, int]] = []
        for frame in (f for f in self.frames if f.t >= since):
            function, node, data = frame.id & 0x780, frame.id & 0x7F, frame.data
            if function == 0x200 or (function == 0x600 and data[:4] == b"\x2b\x40\x60\x00"):
                word = data[:2] if function == 0x200 else data[4:6]
                found.append((frame.t, node, int.from_bytes(word, "little")))
        return found

    def check(
        self, *, held: bool = True, journal: bool = True, log: bool = True, part: bool = False, opened: bool = True
    ) -> RunReport:
        """What holds whatever the fault was.

        held: every winch was seen to stand still; journal, log: the disk took them; part: a full disk left one behind;
        opened: each recording that began has a file.
        """
        report = self.report
        assert self.planted, "the fault was never planted"
        for drive, (place, speed), rest in zip(self.drives, self.shafts, self.rest, strict=True):
            assert drive.state in SAFE, drive.state
            assert speed == 0.0, f"drive {drive.node_id} still turns"
            assert place == pytest.approx(rest, abs=1.0), f"drive {drive.node_id} turned after the run"
        assert report.held is held, report.held_says
        assert report.reason.strip()
        if journal:
            self._check_journal(report)
        self._check_folder(report, part=part, opened=opened)
        if log:
            logged = list(read_candump(self.folder / "can.log"))
            assert [(f.id, f.data) for f in logged] == [(f.id, f.data) for f in self.frames]
        return report

    def _check_journal(self, report: RunReport) -> None:
        held, finished = self.journal[-2:]
        assert (held.kind, finished.kind) == (Kind.HELD, Kind.RUN_FINISHED)
        assert (finished.outcome, finished.reason) == (report.outcome, report.reason)
        assert (held.outcome, held.reason) == (Outcome.PASS if report.held else Outcome.ERROR, report.held_says)
        assert (self.trip is None) == (not [e for e in self.journal if e.kind is Kind.TRIPPED])

    def _check_folder(self, report: RunReport, *, part: bool, opened: bool) -> None:
        """Accepted windows are whole and listed, the others are kept, nothing is spliced, nothing is missing."""
        left = [path for path in self.folder.rglob("*.part") if part is False]
        assert [path for path in left if path.parent.name != "rejected" or ".mcap" not in path.suffixes] == []
        if report.accepted:
            campaign = read_campaign(self.folder)
            assert [w.id for w in campaign.windows] == [row.id for row in report.accepted]
            assert {len(w.t) for w in campaign.windows} == {self.rows}
        files = [path for path in self.folder.glob("[wr]*/*") if ".csv" in path.suffixes]
        assert len(files) == len(self.begun.get("Record", ())) or not opened
        for file in files:
            self.check_rows(file)
            if "cannot be written" not in report.reason:
                self.check_log(file)

    def first_number(self, file: Path) -> int | None:
        """The frame number of a window's first row; None for a file without a marker."""
        at, place = next(iter(places(file).items()), (0, None))
        return None if place is None else next(n for n, f in self.markers.items() if _is(f, place)) - at

    def check_rows(self, file: Path) -> None:
        """Each row is the frame of its number, or blank where there was none."""
        text = file.read_text()
        assert text.endswith("\n") or not text
        first, found = self.first_number(file), places(file)
        for k, line in enumerate(text.splitlines()[1:] if first is not None else ()):
            assert float(line.partition(",")[0]) == pytest.approx(k / RATE, abs=1e-6)
            frame = self.markers.get(first + k)
            if k in found:
                assert frame is not None
                assert _is(frame, found[k]), f"{file.name}, row {k}"
            else:
                assert frame is None or frame.positions[0] is None, f"{file.name}: frame {first + k} is missing"

    def check_log(self, file: Path) -> None:
        """The MCAP file beside a window has the same rows; it is whole unless the window was broken off."""
        log = file.with_suffix(".mcap")
        log = log if log.exists() else log.with_name(log.name + ".part")
        contents = read_mcap(log)
        assert contents.complete == (log.suffix == ".mcap")
        rows = [message.value for message in contents.of("/window")]
        assert len(rows) == file.read_text().count("\n") - 1
        found = places(file)
        for k, row in enumerate(rows):
            assert (k in found) == (not math.isnan(row.markers[0]))
            assert k not in found or np.allclose(row.markers[:3], found[k], rtol=0, atol=ROUNDING)


def places(file: Path) -> dict[int, np.ndarray]:
    """The main marker by row, where it is not blank; also of a file that a full disk has cut short."""
    rows = [line.split(",") for line in file.read_text().splitlines()[1:]]
    return {k: np.array([float(value) for value in row[1:4]]) for k, row in enumerate(rows) if row[1]}


def _is(frame: MarkerFrame, place: np.ndarray) -> bool:
    return frame.positions[0] is not None and bool(np.allclose(frame.positions[0], place, rtol=0, atol=ROUNDING))


class Rehearsal:
    """One run to come. `at` plants faults; `run` carries it out, and the world lives on for a second."""

    def __init__(self, robot: Robot, folder: Path, faults: Faults | None = None) -> None:
        self.robot, self.folder = robot, folder
        self.plan = ONE
        self.seed = 1
        self.settings = short()
        self.real_time = False
        self.listeners: tuple[Callable[[Event], None], ...] = ()
        """after our own"""
        self._mocap = MocapFaults(faults)
        self._plants: list[tuple[str, int, float, Callable[[Stage], Any]]] = []

    def at(self, step: str, fault: Callable[[Stage], Any], *, after: float = 0.0, nth: int = 1) -> None:
        """Plant a fault so many seconds after the nth step of a type begins; step "": before anything begins."""
        self._plants.append((step, nth, after, fault))

    def run(self, experiment: Experiment | None = None, **more: Any) -> Ended:
        """`more` goes to `run_procedure`. Raises what it raises before the first step, and what only a bug raises."""
        experiment = experiment or catalogue.experiment("identify", self.plan, self.robot, self.settings)
        seen = Ended(self.folder, round(self.settings.record.seconds * RATE) + 1)
        ended: list[Ended] = []
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(Laboratory, "_markers", _noting(seen.truth))
            try:
                compose.run_loop(self._main(experiment, seen, ended, more), real_time=self.real_time)
            except KeyboardInterrupt as problem:
                return replace(ended[0], error=problem)
        return ended[0]

    async def _main(self, experiment: Experiment, seen: Ended, ended: list[Ended], more: dict[str, Any]) -> None:
        world = compose.simulated_world(self.robot, self.seed, ())
        async with (
            compose.simulated_rig(
                self.robot, STANDS, world, self.seed, real_time=self.real_time, faults=self._mocap.faults
            ) as rig,
            _following(rig, seen.markers),
        ):
            self._mocap.now, self._mocap.begin = rig.rig.clock.now, rig.rig.clock.now()
            stage = Stage(rig, self.robot, rig.rig.clock.now, self._mocap)
            rig.transport.tap(seen.frames.append)
            self._plant("", 1, stage, seen)
            await rig.rig.clock.sleep(0.0)
            try:
                await self._carry_out(experiment, stage, seen, more)
            finally:
                if seen.events:
                    await uninterrupted(_afterwards(rig, seen, ended))

    async def _carry_out(self, experiment: Experiment, stage: Stage, seen: Ended, more: dict[str, Any]) -> None:
        logs: list[CandumpLog] = []

        def hear(event: Event) -> None:
            seen.events.append(event)
            if not logs:
                logs.append(CandumpLog(self.folder / "can.log"))
                for frame in seen.frames:
                    logs[0].write(frame)
                stage.rig.transport.tap(logs[0].write)
            if isinstance(event, StepStarted):
                name = type(event.step).__name__
                seen.begun.setdefault(name, []).append(stage.now())
                self._plant(name, len(seen.begun[name]), stage, seen)

        rest = {"wall_time": lambda: "2000-01-01T00:00:00Z", "listeners": (hear, *self.listeners), **more}
        guard = LogGuard(lambda: logs[0].error if logs else None)
        try:
            guards = (guard, *rest.pop("guards", ()))
            await run_procedure(experiment, stage.rig.rig, self.folder, guards=guards, **rest)
        finally:
            for task in stage.tasks:
                task.cancel()
            for log in logs:
                log.close()

    def _plant(self, name: str, number: int, stage: Stage, seen: Ended) -> None:
        async def later(after: float, fault: Callable[[Stage], Any]) -> None:
            await stage.rig.rig.clock.sleep(after)
            seen.planted.append(stage.now())
            fault(stage)

        for step, nth, after, fault in self._plants:
            if (step, nth) == (name, number):
                stage.tasks.append(asyncio.ensure_future(later(after, fault)))


@asynccontextmanager
async def _following(rig: compose.SimulatedRig, markers: dict[int, MarkerFrame]) -> AsyncIterator[None]:
    """Take every marker frame, as a second reader beside the recorder."""
    frames = rig.rig.markers.frames()

    async def follow() -> None:
        while True:
            with suppress(FidimError):  # a silent stream says so; it may come back
                async for frame in frames:
                    markers[frame.number] = frame
                return

    task = asyncio.ensure_future(follow())
    try:
        yield
    finally:
        task.cancel()


async def _afterwards(rig: compose.SimulatedRig, seen: Ended, ended: list[Ended]) -> None:
    """Let the world live on, whatever the master does, and look at the shafts."""
    clock, shafts, frames = rig.rig.clock, rig.laboratory.shafts, list(seen.frames)
    rest = tuple(shaft.motion(clock.now()).position for shaft in shafts)
    await clock.sleep(AFTERWARDS)
    motions = [shaft.motion(clock.now()) for shaft in shafts]
    after = tuple((motion.position, motion.velocity) for motion in motions)
    ended.append(replace(seen, frames=frames, drives=rig.drives, rest=rest, shafts=after))


def _noting(truth: dict[int, np.ndarray]) -> Callable[[Laboratory, float], np.ndarray]:
    """Cameras that note where the main marker truly is in each frame; the first frame's number is 1."""
    look = Laboratory._markers

    def note(laboratory: Laboratory, t: float) -> np.ndarray:
        there = look(laboratory, t)
        truth[len(truth) + 1] = there[0].copy()
        return there

    return note


STARVED = ("not answer for", "0x8130", "this computer did nothing for")
"""what a run stops for on a computer that has no time for it: hardware's limits, and the drives in the same process"""


@dataclass(frozen=True)
class Scene:
    """What tests take from here."""

    robot: Robot
    path: Path
    two: Plan = TWO
    short = staticmethod(short)
    places = staticmethod(places)

    def make(self, faults: Faults | None = None, folder: str = "run") -> Rehearsal:
        return Rehearsal(self.robot, self.path / folder, faults)

    def in_real_time(self, prepare: Callable[[Rehearsal], None], starved: Sequence[str] = STARVED) -> Ended:
        """Run on real bus threads and sockets; anew where a busy machine starved the host or the simulated drives.

        Such a run rightly stops: before anything was planted, or with one of the words of `starved`.
        """
        for attempt in range(5):
            rehearsal = self.make(folder=f"real{attempt}")
            rehearsal.real_time = True
            prepare(rehearsal)
            ended = rehearsal.run()
            if ended.planted and not any(says in ended.report.reason for says in starved):
                break
        return ended


@pytest.fixture
def scene(irma4: Robot, tmp_path: Path) -> Scene:
    return Scene(irma4, tmp_path)


@pytest.fixture
def rehearsal(scene: Scene) -> Rehearsal:
    return scene.make()
