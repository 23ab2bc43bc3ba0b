"""What a fault may break while a run goes on."""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

from benchmarks.rehearsal.plans import RATE
from fidim_lab.app import compose
from fidim_lab.data.records import Robot
from sim_backends.drive.node import SimulatedDrive
from sim_backends.mocap.faults import During, Faults, Freeze, Jump, Occlusion


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
