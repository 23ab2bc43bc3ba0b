"""One run to come: faults are planted at its steps, it is carried out, and the world lives on for a second."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from benchmarks.rehearsal.ended import Ended
from benchmarks.rehearsal.plans import ONE, RATE, STANDS, short
from benchmarks.rehearsal.stage import MocapFaults, Stage
from drivers.canbus.candump import CandumpLog
from drivers.ports import MarkerFrame
from fidim_lab.app import compose
from fidim_lab.data.records import Robot
from fidim_lab.errors import FidimError
from procedures.control import Control
from procedures.events import Event, StepStarted
from procedures.guards.robot_guards import LogGuard
from procedures.handlers import placing
from procedures.protocols import catalogue
from procedures.protocols.experiment import Experiment
from procedures.run import run_procedure
from procedures.timing import uninterrupted
from sim_backends.laboratory import Laboratory
from sim_backends.mocap.faults import Faults

AFTERWARDS = 1.0
"""s for which the world lives on after a run, to see that nothing moves any more"""


class Rehearsal:
    """One run to come. `at` plants faults; `run` carries it out, and the world lives on for a second."""

    def __init__(self, robot: Robot, folder: Path, faults: Faults | None = None) -> None:
        self.robot, self.folder = robot, folder
        self.plan = ONE
        self.seed = 1
        self.settings = short()
        self.real_time = False
        self.deadline: float | None = None
        """s after which a run that goes on is cancelled; `run` then raises TimeoutError"""
        self.listeners: tuple[Callable[[Event], None], ...] = ()
        """after our own"""
        self.periods = placing.PERIODS
        """of the slowest swing, that each look takes while the winches are tried: half of a run's time at rest"""
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
        with (
            patch.object(Laboratory, "_markers", _noting(seen.truth)),
            patch.object(placing, "PERIODS", self.periods),
        ):
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
            stage = Stage(rig, self.robot, rig.rig.clock.now, self._mocap, Control())
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

        rest = {
            "wall_time": lambda: "2000-01-01T00:00:00Z",
            "listeners": (hear, *self.listeners),
            "write": stage.disk.write,
            "control": stage.control,
            **more,
        }
        guard = LogGuard(lambda: logs[0].error if logs else None)
        try:
            guards = (guard, *rest.pop("guards", ()))
            async with asyncio.timeout(self.deadline):
                await run_procedure(experiment, stage.rig.rig, self.folder, guards=guards, **rest)
        finally:
            try:
                await uninterrupted(_ended(stage.tasks))
            finally:  # an impatient interrupt reaches the end of the faults, too
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


async def _ended(tasks: list[asyncio.Future[Any]]) -> None:
    """End what faults still do. Raises what went wrong in one: a fault that was not planted must not pass for one."""
    for task in tasks:
        task.cancel()
    for came in await asyncio.gather(*tasks, return_exceptions=True):
        if isinstance(came, Exception) and not isinstance(came, FidimError):
            raise came


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
    look = Laboratory._markers  # noqa: SLF001  # what the cameras ask, before noise and faults

    def note(laboratory: Laboratory, t: float) -> np.ndarray:
        there = look(laboratory, t)
        truth[len(truth) + 1] = there[0].copy()
        return there

    return note
