"""A service on a simulated rig whose clock jumps, and clients on the same loop: hours in seconds, each time alike."""

import asyncio
import tempfile
from collections.abc import Awaitable, Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drivers.ports import PromptKind
from fidim_lab.app import compose
from fidim_lab.app.service.client import ServiceClient, connect
from fidim_lab.app.service.commands import Message, Start
from fidim_lab.app.service.process.board import DefaultAnswer
from fidim_lab.app.service.process.opening import Opened
from fidim_lab.app.service.process.service import Identity, Service
from fidim_lab.data.records import Plan, PlannedWindow, Robot, Role
from procedures.handlers import placing
from procedures.protocols import catalogue
from procedures.report import RunReport, WindowRow
from procedures.run import run_procedure
from procedures.settings import HandSettings, MotionSettings, PlaceSettings, RecordSettings, Settings, TensionSettings
from sim_backends.jumping_loop import run

ALWAYS = {kind: DefaultAnswer(kind and "done") for kind in PromptKind}


def planned(id_: str, lengths: tuple[float, ...], position: tuple[float, ...], part: float = 1.0) -> PlannedWindow:
    displacement = part * np.array([-0.02, 0.03])
    return PlannedWindow(id_, Role.IDENTIFY, np.array(lengths), displacement, np.array(position))


TWO = Plan(
    "two windows",
    (
        planned("i01", (1.30283, 1.39119, 1.52772, 1.41231), (1.111, -0.271, -0.315)),
        planned("i02", (1.36283, 1.37119, 1.49772, 1.46231), (1.175, -0.260, -0.352), 0.6),  # more falls under 20 N
    ),
)


ONE = Plan("one window", TWO.windows[:1])


LONGEST = 600.0
LOOKS = 0.4
"""periods of the slowest swing, instead of two: the simulated robot rests before its winches are tried"""


def short() -> Settings:
    return Settings(
        motion=MotionSettings(settle_over=2.0, length_limits=compose.length_limits(TWO)),
        tension=TensionSettings(over=0.2),
        hand=HandSettings(over=0.3, timeout=2.0),
        place=PlaceSettings(over=0.3, speed=0.05, acceleration=0.3),
        record=RecordSettings(seconds=1.5),
    )


@dataclass
class Serving:
    """One service; `run` carries out what clients do to it, and gives the exit code."""

    robot: Robot
    folder: Path
    socket: Path
    answers: dict[PromptKind, DefaultAnswer] = field(default_factory=lambda: dict(ALWAYS))
    stay: bool = False
    plan: Plan = ONE
    two = TWO
    service: Service | None = None
    rig: Any = None

    def run(self, script: Callable[["Serving"], Awaitable[None]]) -> int:
        return run(self._main(script))

    def client(self, name: str = "test", **more: Any) -> Any:
        return connect(self.socket, name=name, **more)

    async def begin(self, client: ServiceClient) -> None:
        await client.take_lease()
        await client.reset()
        await client.require(Start())

    async def until(self, client: ServiceClient, wanted: Callable[[Any], bool]) -> Message:
        async for message in client:
            if wanted(message):
                return message
        pytest.fail("the service ended before it said what was waited for")

    async def _main(self, script: Callable[["Serving"], Awaitable[None]]) -> int:
        experiment = catalogue.experiment("identify", self.plan, self.robot, short())
        world = compose.simulated_world(self.robot, 1, ())
        async with compose.simulated_rig(self.robot, self.plan, world, 1) as simulated:
            self.rig = simulated
            opened = Opened(simulated.rig, simulated.rig.operator, simulated.transport.tap, 1e6)
            rows = [WindowRow(window, role) for window, role in experiment.roles.items()]
            identity = Identity(self.folder, "a simulated rig", self.stay)
            self.service = service = Service(experiment, opened, identity, rows, self.answers)
            await service.hub.listen_unix(self.socket)

            async def carry(service: Service) -> RunReport:
                return await run_procedure(
                    experiment,
                    service.rig,
                    self.folder,
                    wall_time=lambda: "2026-01-01T00:00:00Z",
                    listeners=service.listeners(),
                    control=service.control,
                )

            serving = asyncio.ensure_future(service.serve(carry))
            try:
                # simulated seconds: a script that waits for what never comes fails instead of running on
                await asyncio.wait_for(script(self), LONGEST)
                return await asyncio.wait_for(serving, LONGEST)
            finally:
                serving.cancel()
                await asyncio.gather(serving, return_exceptions=True)


@pytest.fixture
def socket_path() -> Iterator[Path]:
    with tempfile.TemporaryDirectory(prefix="fs") as folder:  # a socket's path has 107 characters at most
        yield Path(folder) / "s"


@pytest.fixture
def serving(irma4: Robot, tmp_path: Path, socket_path: Path, monkeypatch: pytest.MonkeyPatch) -> Serving:
    monkeypatch.setattr(placing, "PERIODS", LOOKS)
    return Serving(irma4, tmp_path / "run", socket_path)
