"""A service that plays no experiment but speaks the real protocol over a Unix socket, and a UI attached to it."""

import asyncio
import tempfile
import time
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from textual.pilot import Pilot

from drivers.clock import LoopClock
from fidim_lab.app.service.codec import encode
from fidim_lab.app.service.commands import (
    AnswerPrompt,
    Command,
    EmergencyStop,
    Request,
    Reset,
    TakeLease,
)
from fidim_lab.app.service.latch import first_words
from fidim_lab.app.service.messages import (
    Answer,
    BusState,
    EquilibriumState,
    GuardState,
    Happening,
    History,
    MocapState,
    PromptClosed,
    Question,
    Status,
    StepState,
    Welcome,
    WinchState,
)
from fidim_lab.app.service.process.hub import Hub
from fidim_lab.app.service.process.session import ServerSession
from fidim_lab.app.tui.app import FidimUi
from fidim_lab.app.tui.link import Finder, Link

CODE = "7319"


def winch(number: int, **more: Any) -> WinchState:
    known: dict[str, Any] = {
        "name": f"winch {number}",
        "drive": "operation enabled",
        "length": 1.3 + 0.1 * number,
        "speed": 0.0,
        "tension": 40.0 + 10 * number,
        "temperature": 31.0,
        "following_error": 0.0002,
        "age": 0.01,
        "length_limits": (0.3, 3.5),
        "tension_limits": (20.0, 200.0),
    }
    return WinchState(**{**known, **more})


def state(**more: Any) -> Status:
    known: dict[str, Any] = {
        "t": 12.0,
        "wall": "2026-01-02T10:11:12.000",
        "phase": "running",
        "latched": False,
        "commanding": 1,
        "watching": 1,
        "step": StepState(
            number=5, step="Record", window="i02", text="record 10 s", phase="recording", fraction=0.4, left=754.0
        ),
        "winches": tuple(winch(k) for k in (1, 2, 3, 4)),
        "mocap": MocapState(
            rate=100.0, measured_rate=99.0, age=0.02, position=(1.1, -0.27, -0.31), markers_seen=1, counters={"lost": 2}
        ),
        "bus": BusState(load=0.12, frames=940.0),
        "guards": (
            GuardState(name="tension", state="armed", reaction="quick stop"),
            GuardState(name="marker", state="armed", reaction="hold"),
        ),
        "equilibria": (
            EquilibriumState(
                window="i01",
                role="identify",
                state="done",
                verdict="marginal",
                reason="amplitude 41 mm is near the least, 40 mm",
                attempts=2,
                margin=31.5,
                amplitude=0.041,
            ),
            EquilibriumState(window="i02", role="identify", state="current", attempts=1, margin=12.0),
            EquilibriumState(window="v01", role="validate", state="waiting"),
        ),
        "loop_late": 0.003,
    }
    return Status(**{**known, **more})


QUESTION = Question(
    number=1,
    kind="displace-and-release",
    window="i02",
    text="Displace the platform, keep it still, and let go.",
    choices=("done", "skip", "abort"),
    displacement=(-0.02, 0.04),
)


@dataclass
class FakeService:
    """Told what to say; keeps what it is asked."""

    socket: Path
    folder: Path
    state: Status = field(default_factory=state)
    events: list[Happening] = field(default_factory=list)
    question: Question | None = None
    asked: list[Command] = field(default_factory=list)
    silent: bool = False
    deaf: bool = False
    hub: Hub | None = None
    rig: str = "test rig"
    heard: asyncio.Event = field(default_factory=asyncio.Event)
    """an emergency stop"""

    async def run(self) -> None:
        clock = LoopClock()
        self.hub = Hub(self._answer, self._greet, lambda client: None)
        try:
            await self.hub.listen_unix(self.socket)
            while True:
                await clock.sleep(0.05)
                if not self.silent:
                    self.hub.tell(self.now())
        finally:
            self.hub.close()

    def now(self) -> Status:
        return self.state.model_copy(update={"prompt": None if self.question is None else self.question.number})

    def become(self, **more: Any) -> None:
        self.state = state(**more)

    def winches(self, **first: Any) -> tuple[WinchState, ...]:
        return winch(1, **first), *(winch(k) for k in (2, 3, 4))

    def ask(self, **more: Any) -> None:
        self.question = QUESTION.model_copy(update=more)
        self.say(self.question)

    def say(self, message: Any) -> None:
        assert self.hub is not None
        self.hub.tell(message)

    def _greet(self, client: ServerSession) -> Iterator[bytes]:
        welcome = Welcome(
            you=client.number,
            run="two windows",
            folder=str(self.folder),
            rig=self.rig,
            windows=("i01", "i02", "v01"),
            winches=("winch 1", "winch 2", "winch 3", "winch 4"),
        )
        said: list[Any] = [welcome, History(events=tuple(self.events)), self.now()]
        return map(encode, [*said, self.question] if self.question is not None else said)

    def _answer(self, client: ServerSession, request: Request) -> Answer:
        command = request.command
        self.asked.append(command)
        ok, says, code = True, "", ""
        match command:
            case EmergencyStop():
                self.heard.set()
                self.state = self.state.model_copy(update={"latched": True, "latched_why": "by the test"})
                says = "All winches were quick-stopped."
            case Reset(code=""):
                code, says = CODE, first_words(self.state.latched_why)
            case Reset():
                ok = command.code == CODE
                self.state = self.state.model_copy(update={"latched": not ok})
            case TakeLease():
                self.state = self.state.model_copy(update={"commanding": client.number})
            case AnswerPrompt():
                self.question = None
                self.say(PromptClosed(number=command.prompt, choice=command.choice, by=client.name))
            case _:
                pass
        return Answer(id=-1 if self.deaf else request.id, ok=ok, says=says, code=code)

    def commands(self) -> list[str]:
        return [command.name for command in self.asked]


PATIENCE = 60.0
"""s, on a computer that others use too"""


@dataclass
class Screen:
    """A UI under test."""

    app: FidimUi
    pilot: Pilot[None]
    service: FakeService
    serving: "asyncio.Task[None]"

    @property
    def board(self) -> str:
        stage = self.app.stage
        return stage.boards[stage.current].text

    @property
    def bars(self) -> str:
        return f"{self.app.stage.state.text}\n{self.app.stage.prompt.text}"

    @property
    def over(self) -> str:
        """Text of a dialog."""
        return "\n".join(board.text for board in self.app.screen.query("Board").results())  # type: ignore[attr-defined]

    async def press(self, *keys: str) -> None:
        await self.pilot.press(*keys)
        await self.pilot.pause(0.02)

    async def click(self, where: str, offset: tuple[int, int]) -> None:
        """Where the board stands by then: on a busy computer it can still move between the look and the finger."""
        for _ in range(100):
            before = self.app.screen.query_one(where).region
            await self.pilot.pause(0.02)
            if self.app.screen.query_one(where).region == before and await self.pilot.click(where, offset=offset):
                return
        pytest.fail(f"{where} never stood still")

    async def until(self, wanted: Callable[[], bool], what: str = "") -> None:
        clock = LoopClock()
        end = clock.now() + PATIENCE
        while clock.now() < end:
            if wanted():
                return
            await self.pilot.pause(0.02)
        pytest.fail(f"never came: {what}; the screen shows\n{self.bars}\n{self.board}")

    async def keys(self, *keys: str) -> None:
        """Press these without waiting for what they do to be drawn, as fast fingers do."""
        for key in keys:
            self.app.simulate_key(key)
            await LoopClock().sleep(0.01)

    async def stop(self, key: str = "f12") -> float:
        """Press the emergency stop; returns how long this process worked (s of CPU) until the service heard it.

        What other programs take of a busy computer does not count; waiting for a file or a lock would never end.
        """
        self.service.heard.clear()
        begun = time.process_time()
        self.app.simulate_key(key)
        try:
            await asyncio.wait_for(self.service.heard.wait(), PATIENCE)
        except TimeoutError:
            pytest.fail(f"not stopped; the screen shows\n{self.bars}\n{self.over}")
        return time.process_time() - begun

    def kill_service(self) -> None:
        self.serving.cancel()

    def start_service(self) -> None:
        self.serving = asyncio.ensure_future(self.service.run())


Opener = Callable[..., Any]


@pytest.fixture
def fake(tmp_path: Path) -> Iterator[FakeService]:
    run = tmp_path / "runs" / "today"
    run.mkdir(parents=True)
    with tempfile.TemporaryDirectory(prefix="fu") as folder:  # a socket's path has 107 characters at most
        yield FakeService(Path(folder) / "s", run)


@pytest.fixture
def opened(fake: FakeService, monkeypatch: pytest.MonkeyPatch) -> Opener:
    """A UI attached to the fake service, live."""
    monkeypatch.setattr("fidim_lab.app.tui.foresight.Foresight.look", lambda *a: None)  # no worker process
    monkeypatch.setattr("fidim_lab.app.tui.view.STALE", 3.0)  # tests share a busy computer
    monkeypatch.setattr("fidim_lab.app.tui.app.SETTLE", 0.0)

    @asynccontextmanager
    async def opened(size: tuple[int, int] = (80, 24), *, light: bool = False) -> AsyncIterator[Screen]:
        clock = LoopClock()
        app = FidimUi(Link(Finder(socket=fake.socket), clock), clock, light=light)
        serving = asyncio.ensure_future(fake.run())
        try:
            async with app.run_test(size=size) as pilot:
                screen = Screen(app, pilot, fake, serving)
                serving = None
                await screen.until(lambda: "● live" in screen.bars, "a live service")
                try:
                    yield screen
                finally:
                    with suppress(TimeoutError):  # keys that were pressed last find the screens still there
                        await asyncio.wait_for(pilot.pause(), PATIENCE)
                    screen.kill_service()
                    await asyncio.gather(screen.serving, return_exceptions=True)
        finally:
            if serving is not None:
                serving.cancel()

    return opened
