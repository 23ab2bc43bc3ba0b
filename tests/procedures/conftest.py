"""A small deterministic laboratory: winches, markers and an operator that misbehave when told to.

It has no physics: lengths go where they are sent, the marker swings as a cosine once it is let go.
"""

import asyncio
import math
from collections.abc import AsyncIterator, Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drivers.clock import LoopClock
from drivers.ports import DriveState, MarkerFrame, Prompt, PromptKind, Rig, WinchSample
from drivers.trajectory import Trajectory
from fidim_lab.data.records import Plan, PlannedWindow, Robot, Role
from fidim_lab.errors import DeviceError
from procedures.events import Event, StepStarted
from procedures.protocols import catalogue
from procedures.report import RunReport
from procedures.run import run_procedure
from procedures.settings import Settings
from sim_backends.jumping_loop import run

CYCLE = 0.004
RATE = 100.0
FOREVER = math.inf
NEWTON_PER_AMPERE = 34.0
NOISE = 1e-9
"""part of its value by which an ammeter scatters"""
AT_ONCE = 1e6
"""m/s²"""


class FakeWinch:
    """Goes at constant speed to where it is sent."""

    def __init__(self, name: str, world: "World") -> None:
        self.name = name
        self.world = world
        self.state = DriveState.SWITCH_ON_DISABLED
        self.configured = False
        self.commands: list[str] = []
        self.fault = ""
        self.tension: float | None = None
        self.silent_since = FOREVER
        self.refuses = ""
        self.hangs = False
        self.creep = 0.0
        self._from, self._to, self._begin, self._speed = 1.4, 1.4, 0.0, 1.0
        self.commanded: Trajectory | None = None
        self.powered = False
        self._answers = False
        """by SDO, after its PDOs were taken away"""

    def _command(self, name: str) -> None:
        self.commands.append(name)
        if self.refuses == name:
            raise DeviceError(self.name, f"refuses to {name}.", hint="Look at its display.")

    async def configure(self) -> None:
        self._command("configure")
        await self.world.clock.sleep(0.02)
        self.configured = True

    async def enable(self) -> None:
        self._command("enable")
        self.commanded = Trajectory.standing(self.world.now(), self.length(self.world.now()))
        self.powered = True
        await self.world.clock.sleep(0.1)
        self.state = DriveState.OPERATION_ENABLED

    async def prepare(self, speed: float, acceleration: float) -> None:
        self._command("prepare")

    async def move_to(self, length: float, speed: float, acceleration: float) -> None:
        self._command("move_to")
        now = self.world.now()
        self._from, self._to, self._begin, self._speed = self.length(now), length, now, speed
        self.commanded = Trajectory(now, self._from, length, speed, AT_ONCE)

    async def hold(self) -> None:
        self._command("hold")
        while self.hangs:
            await self.world.clock.sleep(1.0)
        self._stay()

    def quick_stop(self, *, again: bool = False) -> None:
        self.commands.append("quick_stop")
        self._stay()
        if not self.fault:
            self.state = DriveState.QUICK_STOP_ACTIVE

    def force_stop(self) -> None:
        self.commands.append("force_stop")
        self._answers = self.silent_since == FOREVER
        self.silent_since = self.world.now()

    def fall_silent(self) -> float:
        self.world.fallen_silent = True
        return 0.3

    async def ask_length(self) -> float:
        if self.silent_since < FOREVER and not self._answers:
            raise DeviceError(self.name, "does not answer.")
        return self.length(self.world.now())

    def power_off(self) -> None:
        self.commands.append("power_off")

    def _stay(self) -> None:
        now = self.world.now()
        self._from = self._to = self.length(now)
        self.creep = 0.0
        if self.commanded is not None:
            self.commanded = Trajectory.standing(now, self._to)

    def length(self, t: float) -> float:
        way = self._to - self._from
        passed = self._speed * (t - self._begin)
        return self._from + math.copysign(min(abs(way), passed), way) + self.creep * max(0.0, t - self._begin)

    def velocity(self, t: float) -> float:
        way, passed = self._to - self._from, t - self._begin
        moves = 0.0 <= passed * self._speed < abs(way)
        return self.creep + (math.copysign(self._speed, way) if moves else 0.0)

    def latest(self) -> WinchSample | None:
        if not self.configured:
            return None
        now = min(self.world.now(), self.silent_since)
        t = math.floor(now / CYCLE + 1e-9) * CYCLE
        length = self.length(t)
        tension = self.world.tension(t) if self.tension is None else self.tension
        return WinchSample(
            t=t,
            state=DriveState.FAULT if self.fault else self.state,
            length=length,
            velocity=self.velocity(t),
            current=tension / NEWTON_PER_AMPERE * (1.0 + NOISE * (round(t / CYCLE) % 7)),
            target_reached=length == self._to,
            fault=self.fault,
        )


class FakeMarkers:
    """One marker at 100 Hz; frames may be lost, blank, frozen, doubled or out of order."""

    rate = RATE

    def __init__(self, world: "World") -> None:
        self.world = world
        self.blank_until = -1.0
        self.frozen_until = -1.0
        self.silent_until = -1.0
        self.disorder = False
        self._last: MarkerFrame | None = None

    def frame(self, number: int) -> MarkerFrame | None:
        t = number / RATE
        if t <= self.silent_until:
            return self._last
        position = None if t <= self.blank_until else self.world.marker(number)
        if t <= self.frozen_until and self._last is not None:
            position = self._last.positions[0]
        self._last = MarkerFrame(self.world.now(), number, (position,))
        return self._last

    def latest(self) -> MarkerFrame | None:
        return self.frame(math.floor(self.world.now() * RATE + 1e-6))

    async def frames(self) -> AsyncIterator[MarkerFrame]:
        number = math.floor(self.world.now() * RATE + 1e-6) + 1
        while True:
            await self.world.clock.sleep(number / RATE - self.world.now())
            frame = self.frame(number)
            if frame is not None and frame.number == number:
                yield frame
                if self.disorder and number % 7 == 0:  # what a careless source lets through
                    yield frame
                    yield replace(frame, number=number - 3, positions=((9.0, 9.0, 9.0),))
            number += 1

    def counters(self) -> dict[str, int]:
        return {"received": math.floor(self.world.now() * RATE), "lost": 0}


class FakeOperator:
    """Takes its time, and does what is asked."""

    def __init__(self, world: "World") -> None:
        self.world = world
        self.asked: list[Prompt] = []
        self.answers: dict[PromptKind, str] = {}

    async def answer(self, prompt: Prompt) -> str:
        self.asked.append(prompt)
        await self.world.clock.sleep(2.0)
        if prompt.kind is PromptKind.DISPLACE_AND_RELEASE:
            self.world.let_go()
        if prompt.kind is PromptKind.STEADY:
            self.world.amplitude = 0.0
        return self.answers.get(prompt.kind, prompt.choices[0])


class World:
    """The laboratory; `at` plants a fault at the first step of a type."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.clock = LoopClock()
        self.winches = tuple(FakeWinch(f"winch {k}", self) for k in range(1, robot.n + 1))
        self.markers = FakeMarkers(self)
        self.operator = FakeOperator(self)
        self.fallen_silent = False
        self.amplitude = 0.0
        self.displacement = 0.03
        self.released = 0.0
        self.events: list[Event] = []
        self.settings = Settings()
        self.write: Callable[[int, bytes], int] | None = None
        self._plants: list[tuple[str, float, Callable[[], Any]]] = []
        self._tasks: list[asyncio.Future[None]] = []

    def now(self) -> float:
        return self.clock.now()

    def let_go(self) -> None:
        self.amplitude, self.released = self.displacement, self.now()

    def marker(self, number: int) -> tuple[float, float, float]:
        t = number / RATE
        swing = self.amplitude * math.cos(2 * math.pi * 1.3 * (t - self.released))
        noise = 1e-4 * math.sin(12.9898 * number)
        return (1.2 + swing + noise, -0.2 + 0.4 * swing - noise, -0.3 + noise / 2)

    def tension(self, t: float) -> float:
        return 60.0 + 600.0 * self.amplitude * math.sin(2 * math.pi * 1.3 * (t - self.released))

    def at(self, step: str, fault: Callable[[], Any], *, after: float = 0.0) -> None:
        """Let `fault` happen so many seconds after the first step of this type begins."""
        self._plants.append((step, after, fault))

    async def _later(self, after: float, fault: Callable[[], Any]) -> None:
        await self.clock.sleep(after)
        fault()

    def hear(self, event: Event) -> None:
        self.events.append(event)
        if isinstance(event, StepStarted):
            for plant in tuple(self._plants):
                step, after, fault = plant
                if step == type(event.step).__name__:
                    self._plants.remove(plant)
                    if after:
                        self._tasks.append(asyncio.ensure_future(self._later(after, fault)))
                    else:
                        fault()

    @property
    def rig(self) -> Rig:
        return Rig(self.clock, self.winches, self.markers, self.operator)

    @property
    def stopped(self) -> bool:
        """No winch has moved on, and the last word to each was hold or quick stop."""
        return all(w.commands[-1] in ("hold", "quick_stop") for w in self.winches)

    def motions_after(self, word: str) -> int:
        """How many moves were ordered after a winch was first told `word`."""
        return sum(w.commands[w.commands.index(word) :].count("move_to") for w in self.winches if word in w.commands)

    async def carry_out(self, plan: Plan, folder: Path, procedure: str = "identify", **more: Any) -> RunReport:
        experiment = catalogue.experiment(procedure, plan, self.robot, self.settings, statics=comfortable)
        if self.write is not None:
            more["write"] = self.write
        more.setdefault("listeners", (self.hear,))
        return await run_procedure(experiment, self.rig, folder, wall_time=lambda: "2026-01-01T00:00:00Z", **more)

    def run(self, plan: Plan, folder: Path, **more: Any) -> RunReport:
        return run(self.carry_out(plan, folder, **more))


def comfortable(lengths: np.ndarray) -> np.ndarray:
    """60 N in every cable, wherever the platform is."""
    return np.full(len(lengths), 60.0)


def make_plan(sets: Sequence[Sequence[float]], name: str = "two windows") -> Plan:
    windows = tuple(
        PlannedWindow(
            f"i{k:02d}", Role.IDENTIFY, np.array(lengths), np.array([0.03, 0.012]), np.array([1.2, -0.2, -0.3])
        )
        for k, lengths in enumerate(sets, start=1)
    )
    return Plan(name, windows)


@dataclass(frozen=True)
class Lab:
    """What tests take from here."""

    make_world: Callable[[], World]
    make_plan: Callable[..., Plan]
    plan: Plan = field(default_factory=lambda: make_plan([(1.5, 1.4, 1.4, 1.4), (1.5, 1.45, 1.4, 1.4)]))
    one: Plan = field(default_factory=lambda: make_plan([(1.5, 1.4, 1.4, 1.4)], "one window"))


@pytest.fixture
def lab(irma4: Robot) -> Lab:
    return Lab(lambda: World(irma4), make_plan)


@pytest.fixture
def world(lab: Lab) -> World:
    return lab.make_world()
