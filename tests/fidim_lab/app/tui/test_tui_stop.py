"""The emergency stop from every state of the UI: each screen, each dialog, each size, while files and service fail.

`python -m benchmarks.ui_stop` measures the delay of the key in a real terminal.
"""

import asyncio
import itertools
import json
import os
import threading
from typing import ClassVar

import pytest

from drivers.clock import LoopClock
from fidim_lab.app.service.commands import AnswerPrompt
from fidim_lab.app.session.ui import run_ui
from fidim_lab.app.tui.app import FidimUi
from fidim_lab.app.tui.link import Finder, Link
from fidim_lab.app.tui.screens.bars import TABS
from fidim_lab.errors import OurBugError

SCREENS = tuple(str(k + 1) for k in range(len(TABS)))
OVER = {
    "nothing": (),
    "help": ("question_mark",),
    "abort": ("x",),
    "reason": ("k",),
    "reason, text typed": ("k", "d", "o", "n"),
    "filter": ("slash", "d"),
    "palette": ("ctrl+p",),
    "palette, text typed": ("ctrl+p", "a", "b"),
    "an order asked twice": ("x", "x", "k"),
}
WORKED = 3.0
"""s of CPU from the key to the service, on a computer that others use; 0.02 to 0.2 on an idle one"""
STATES = ("running", "prompt", "latched", "silent", "ended phase")


def _run(see, opened, **more):
    async def main():
        async with opened(**more) as screen:
            await see(screen)

    asyncio.run(main())


async def _into(screen, state):
    """Bring the service into a state."""
    fake = screen.service
    match state:
        case "prompt":
            fake.ask()
            await screen.until(lambda: "[d] done" in screen.bars, "the prompt")
        case "latched":
            fake.become(latched=True, latched_why="by hand")
            await screen.until(lambda: "L A T C H E D" in screen.bars, "the latch")
        case "silent":
            fake.silent = True
        case "ended phase":
            fake.become(phase="ended")
        case _:
            pass


@pytest.mark.parametrize("state", STATES)
def test_from_every_screen_and_over_every_dialog(opened, state):
    """Both keys; the stop reaches the service while the dialog is open, and the dialog stays."""
    keys = itertools.cycle(("f12", "ctrl+e"))

    async def see(screen):
        await _into(screen, state)
        for number, (name, way) in itertools.product(SCREENS if state == "running" else SCREENS[:1], OVER.items()):
            await screen.keys(number, *way)
            worked = await screen.stop(next(keys))
            assert worked < WORKED, f"screen {number}, {name}: {worked:.2f} s"
            await screen.keys("escape")
            await screen.until(lambda: len(screen.app.screen_stack) == 1, f"the end of {name}")
            await screen.keys("escape")

    _run(see, opened)


@pytest.mark.parametrize("size", [(1, 1), (39, 5), (300, 100)])
@pytest.mark.sampled(1)
def test_in_a_terminal_of_any_size(opened, size):
    async def see(screen):
        for number, way in itertools.product(SCREENS, (OVER["nothing"], OVER["help"], OVER["palette"], OVER["abort"])):
            await screen.keys(number, *way)
            await screen.stop()
            await screen.keys("escape", "escape")

    _run(see, opened, size=size)


def test_while_the_terminal_changes_its_size(opened):
    async def see(screen):
        for size in ((5, 2), (200, 60), (1, 1), (80, 24)):
            await screen.pilot.resize_terminal(*size)
            await screen.stop()

    _run(see, opened)


FIFO, NESTED, LONG, FOLDER, LINES = "a FIFO", "nested", "long", "a folder", "many lines"


def _spoil(path, kind):
    match kind:
        case "a FIFO":
            os.mkfifo(path)
        case "a folder":
            path.mkdir()
        case "nested":
            path.write_text('{"a":' * 200_000)
        case "many lines":
            path.write_text(json.dumps(_explanation(message="word\n" * 400_000)))
        case _:
            path.write_text("[" + "1," * 2_000_000 + "1]")


def _explanation(**more):
    return {"format": "fidim-explanation/1", "verdict": "explained", "message": "yes", **more}


@pytest.mark.sampled(4)
@pytest.mark.parametrize("name", ["result.json", "explanation.json"])
@pytest.mark.parametrize("kind", [FIFO, NESTED, LONG, FOLDER, LINES])
def test_while_a_file_of_the_run_cannot_be_read(opened, fake, name, kind):
    async def see(screen):
        await screen.press("5")
        _spoil(fake.folder / name, kind)
        for _ in range(12):
            assert await screen.stop() < WORKED
            await LoopClock().sleep(0.1)
        await screen.press("1", "4", "5")
        await screen.stop()

    _run(see, opened)


def test_a_share_that_stalls_is_said_and_stops_no_key(opened, monkeypatch):
    """The thread that waits for it is left alone, and nobody starts another one."""
    waiting, end = threading.Event(), threading.Event()

    def stalled(path):
        waiting.set()
        end.wait(30.0)
        return 0.0

    async def see(screen):
        monkeypatch.setattr("fidim_lab.app.tui.result_files._changed", stalled)
        await screen.press("4")
        await screen.until(waiting.is_set, "a look at the files")
        before = threading.active_count()
        await screen.until(lambda: "have not answered" in screen.board, "that they do not answer")
        await screen.stop()
        await LoopClock().sleep(1.5)
        assert threading.active_count() <= before
        end.set()
        monkeypatch.undo()
        await screen.until(lambda: "have not answered" not in screen.board, "that they do again")

    _run(see, opened)
    end.set()


def test_while_no_connection_is_open_it_makes_one(opened, fake, monkeypatch):
    """A service that dropped this screen still has the robot."""
    monkeypatch.setattr("fidim_lab.app.tui.link.AGAIN", 60.0)

    async def see(screen):
        for connection in tuple(fake.hub._connections):
            connection.end()
        await screen.until(lambda: "SERVICE LOST" in screen.bars, "the loss")
        await screen.stop()
        await screen.until(lambda: "All winches were quick-stopped" in screen.bars, "its answer")

    _run(see, opened)


def test_a_service_that_is_gone_is_said_at_once(opened):
    async def see(screen):
        screen.kill_service()
        await screen.until(lambda: "SERVICE LOST" in screen.bars, "the loss")
        await screen.press("f12")
        await screen.until(lambda: "PRESS THE HARDWARE STOP" in screen.bars, "that nothing was stopped")

    _run(see, opened)


def test_while_it_still_looks_for_its_service(fake):
    """Before anything was attached: the screen is up, the service is there, the connection is not."""

    async def main():
        clock = LoopClock()
        app = FidimUi(Link(Finder(socket=fake.socket), clock), clock)
        async with app.run_test() as pilot:
            await pilot.press("f12")
            while "PRESS THE HARDWARE STOP" not in app.stage.state.text:
                await pilot.pause(0.02)
            serving = asyncio.ensure_future(fake.run())
            await pilot.pause(0.05)
            app.simulate_key("f12")
            await fake.heard.wait()
            serving.cancel()
            await asyncio.gather(serving, return_exceptions=True)

    asyncio.run(asyncio.wait_for(main(), 30.0))


def test_where_a_screen_cannot_be_drawn(opened, monkeypatch):
    async def see(screen):
        def broken(*_):
            raise KeyError("a fault of ours")

        monkeypatch.setattr("fidim_lab.app.tui.stage.rig_lines", broken)
        await screen.press("2")
        await screen.until(lambda: "cannot be drawn" in screen.bars, "the fault")
        assert "test rig" in screen.bars
        await screen.stop()
        await screen.press("1")
        await screen.until(lambda: "cannot be drawn" not in screen.bars, "another screen")

    _run(see, opened)


@pytest.mark.parametrize("way", ["question_mark", "x", "4"])
def test_a_prompt_is_shown_and_answered_over_a_dialog(opened, way):
    async def see(screen):
        await screen.press(way)
        screen.service.ask()
        await screen.until(lambda: "Displace the platform" in (screen.over if way != "4" else screen.bars), "it")
        await screen.press("d")
        await screen.until(lambda: screen.service.asked, "the answer")
        assert screen.service.asked == [AnswerPrompt(prompt=1, choice="done")]

    _run(see, opened)


@pytest.mark.parametrize("way", ["k", "ctrl+p", "slash"])
def test_where_letters_are_typed_a_prompt_says_how_it_is_answered(opened, way):
    async def see(screen):
        await screen.press(way)
        screen.service.ask()
        wanted = "Esc, then   [d] done"
        await screen.until(lambda: wanted in (screen.bars if way == "slash" else screen.over), "the way")
        await screen.press("d")
        assert screen.service.asked == []
        await screen.press("escape", "escape", "d")
        await screen.until(lambda: screen.service.asked == [AnswerPrompt(prompt=1, choice="done")], "the answer")

    _run(see, opened)


def test_yes_and_no_of_a_dialog_answer_no_prompt_below_it(opened):
    async def see(screen):
        screen.service.ask(choices=("yes", "no"))
        await screen.until(lambda: "[y] yes" in screen.bars, "the prompt")
        await screen.press("x", "n")
        assert screen.service.asked == []
        await screen.press("n")
        await screen.until(lambda: screen.service.asked == [AnswerPrompt(prompt=1, choice="no")], "the answer")

    _run(see, opened)


class _Failing:
    """Screens that fail, one after the other, then one that a person leaves."""

    made: ClassVar[list["_Failing"]] = []
    faults: ClassVar[list[Exception | None]] = []

    def __init__(self, link, clock, folder, *, light, says):
        self.says, self.fault = says, None
        self.made.append(self)

    def run(self):
        self.fault = self.faults.pop(0)


@pytest.fixture
def failing(monkeypatch):
    monkeypatch.setattr("fidim_lab.app.session.ui.FidimUi", _Failing)
    monkeypatch.setattr(_Failing, "made", [])
    return _Failing


def test_a_screen_that_fails_begins_anew_and_says_why(failing):
    failing.faults = [KeyError("ours"), None]
    run_ui(Finder(), None)
    assert [one.says for one in failing.made] == ["", "✗ The screen has failed and was restarted (KeyError: 'ours')."]


def test_a_screen_that_fails_again_and_again_sends_to_another_stop(failing):
    failing.faults = [KeyError("ours")] * 9
    with pytest.raises(OurBugError, match="Use fidim stop"):
        run_ui(Finder(), None)
    assert len(failing.made) == 3


def test_what_ends_the_screen_is_kept_and_no_stack_is_printed(fake, monkeypatch, capsys):
    monkeypatch.setattr(FidimUi, "action_order", lambda self, verb: {}["ours"])
    apps = []

    async def main():
        clock = LoopClock()
        apps.append(FidimUi(Link(Finder(socket=fake.socket), clock), clock))
        async with apps[0].run_test() as pilot:
            await pilot.press("g")

    with pytest.raises(KeyError):
        asyncio.run(main())
    assert isinstance(apps[0].fault, KeyError)
    assert "Traceback" not in "".join(capsys.readouterr())
