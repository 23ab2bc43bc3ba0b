"""Whose rig a screen belongs to: named on every screen, never changed without a person's yes; texts that show only."""

import asyncio
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from drivers.clock import LoopClock
from fidim_lab.app.service.commands import Pause
from fidim_lab.app.service.lock import held
from fidim_lab.app.service.messages import Happening
from fidim_lab.app.service.place import ServicePlace
from fidim_lab.app.tui.app import FidimUi
from fidim_lab.app.tui.link import Finder, Link
from fidim_lab.app.tui.screens.bars import TABS

ESCAPES = "\x1b]0;OWNED\x07\x1b[2J\x9b31m[/nope][bold red]x[/][@click=app.bell]y[/]\u202egnp\u200b\n\r\bFAKE"


class Laboratory:
    """Rigs of this user, each with a service or without."""

    def __init__(self, runtime, fake):
        self._runtime, self._fake = runtime, fake
        self._serving = {}

    @asynccontextmanager
    async def service(self, key, rig, folder):
        service = type(self._fake)(ServicePlace(self._runtime, key).socket, folder, rig=rig)
        with held(ServicePlace(self._runtime, key), folder):
            serving = asyncio.ensure_future(service.run())
            try:
                yield service
            finally:
                serving.cancel()
                await asyncio.gather(serving, return_exceptions=True)


@pytest.fixture
def laboratory(fake, monkeypatch):
    runtime = fake.socket.parent / "fidim"
    runtime.mkdir(mode=0o700)
    monkeypatch.setenv("FIDIM_RUNTIME_DIR", str(runtime))
    monkeypatch.setattr("fidim_lab.app.tui.foresight.Foresight.look", lambda *a: None)
    monkeypatch.setattr("fidim_lab.app.tui.view.STALE", 3.0)
    monkeypatch.setattr("fidim_lab.app.tui.link.AGAIN", 0.1)
    return Laboratory(runtime, fake)


@asynccontextmanager
async def _screen(finder):
    clock = LoopClock()
    app = FidimUi(Link(finder, clock), clock)
    async with app.run_test(size=(80, 24)) as pilot:

        async def until(wanted, what):
            for _ in range(600):
                if wanted():
                    return
                await pilot.pause(0.02)
            pytest.fail(f"never came: {what}; the screen shows\n{app.stage.state.text}")

        yield app, pilot, until


def test_another_rig_is_only_offered_until_a_person_says_yes(laboratory, tmp_path):
    async def main():
        async with _screen(Finder()) as (app, pilot, until):
            bars = app.stage.state
            async with laboratory.service("a", "the large rig", tmp_path / "a"):
                await until(lambda: "RIG  the large rig" in bars.text and "● live" in bars.text, "its rig")
            await until(lambda: "SERVICE LOST" in bars.text, "the loss")
            async with laboratory.service("b", "the small rig", tmp_path / "b") as other:
                await until(lambda: "ANOTHER RIG HAS A SERVICE" in bars.text, "the offer")
                assert "RIG  the large rig" in bars.text
                assert "“the small rig”" in bars.text
                await pilot.press("g", "n", "p", "n", "f12")
                await until(lambda: "PRESS THE HARDWARE STOP" in bars.text, "that the large rig is not stopped")
                assert other.asked == []
                await pilot.press("t", "y")
                await until(lambda: "RIG  the small rig" in bars.text and "● live" in bars.text, "the other rig")
                app.simulate_key("f12")
                await other.heard.wait()

    asyncio.run(asyncio.wait_for(main(), 60.0))


def test_the_next_run_of_the_same_rig_needs_no_yes_and_an_offer_is_withdrawn(laboratory, tmp_path):
    async def main():
        async with _screen(Finder()) as (app, _, until):
            bars = app.stage.state
            async with laboratory.service("a", "the large rig", tmp_path / "a"):
                await until(lambda: "● live" in bars.text, "its rig")
            async with laboratory.service("b", "the small rig", tmp_path / "b"):
                await until(lambda: "ANOTHER RIG" in bars.text, "the offer")
                async with laboratory.service("a", "the large rig", tmp_path / "next"):
                    await until(lambda: "● live" in bars.text, "its rig again, of two that are there")
                    assert "ANOTHER RIG" not in bars.text

    asyncio.run(asyncio.wait_for(main(), 60.0))


def test_another_rig_file_on_the_same_bus_is_another_rig(laboratory, tmp_path):
    async def main():
        async with _screen(Finder()) as (app, _, until):
            bars = app.stage.state
            async with laboratory.service("a", "four cables", tmp_path / "a"):
                await until(lambda: "● live" in bars.text, "its rig")
            async with laboratory.service("a", "three cables", tmp_path / "b"):
                await until(lambda: "“three cables” has a service" in bars.text, "the offer")

    asyncio.run(asyncio.wait_for(main(), 60.0))


def test_before_it_belongs_to_a_rig_a_screen_stops_all_that_are_there(laboratory, tmp_path):
    async def main():
        async with (
            laboratory.service("a", "one", tmp_path / "a") as one,
            laboratory.service("b", "two", tmp_path / "b") as two,
            _screen(Finder()) as (app, _, until),
        ):
            await until(lambda: "several services" in app.stage.boards[0].text, "that it cannot choose")
            app.simulate_key("f12")
            await until(lambda: one.heard.is_set() and two.heard.is_set(), "both stops")
            await until(lambda: "EMERGENCY STOP: All winches" in app.stage.state.text, "the answer")

    asyncio.run(asyncio.wait_for(main(), 60.0))


def test_a_service_that_greets_nobody_is_told(laboratory, tmp_path, monkeypatch):
    monkeypatch.setattr("fidim_lab.app.tui.link.GREETS_WITHIN", 0.3)

    async def main():
        place = ServicePlace(laboratory._runtime, "a")
        came = []
        server = await asyncio.start_unix_server(lambda _, writer: came.append(writer), path=place.socket)
        with held(place, tmp_path):
            async with _screen(Finder()) as (app, pilot, until):
                await until(lambda: "did not answer this screen" in app.stage.boards[0].text, "that it is silent")
                await pilot.press("f12")
                await until(lambda: "PRESS THE HARDWARE STOP" in app.stage.state.text, "that nobody answers")
        for writer in came:
            writer.close()
        server.close()

    asyncio.run(asyncio.wait_for(main(), 60.0))


def _drawn(app):
    """Every character as the terminal gets it."""
    return "".join(segment.text for strip in app.screen._compositor.render_strips() for segment in strip)


def test_no_text_of_a_file_or_service_is_obeyed_by_the_terminal(opened, fake):
    """Escapes, markup, direction marks: shown as they are, or as their codes, on every screen."""
    fake.rig = f"rig {ESCAPES}"
    fake.events = [
        Happening(number=1, t=1.0, wall="2026-01-02T10:11:12", kind="paused", text=ESCAPES, reason=ESCAPES),
        Happening(number=2, t=1.0, wall="2026-01-02T10:11:12", kind="model-checked", window="i01", text=ESCAPES),
    ]
    (fake.folder / "explanation.json").write_text(
        '{"format": "fidim-explanation/1", "verdict": "[/nope]\\u001b[2J", "message": "\\ud800 \\u001b]0;X[/]",'
        ' "effects": [{"id": "[@click=app.bell]", "says": "\\u202egnp"}], "next_experiment": "\\u009b2J"}'
    )
    (fake.folder / "result.json").write_text('{"\\u001b[2J": 1, "outcome": "[/nope]\\u001b"}')

    async def see(screen):
        fake.ask(text=f"ask {ESCAPES}", window=ESCAPES)
        fake.become(latched=True, latched_why=ESCAPES, winches=fake.winches(name=ESCAPES, fault=ESCAPES))
        for way in (*(str(k + 1) for k in range(len(TABS))), "x", "question_mark"):
            await screen.press(way)
            await screen.pilot.pause(0.3)
            drawn = _drawn(screen.app)
            assert drawn.isprintable(), [c for c in drawn if not c.isprintable()]
            assert "cannot be drawn" not in drawn
        assert screen.app.is_running

    _run(see, opened)


def _run(see, opened, **more):
    async def main():
        async with opened(**more) as screen:
            await see(screen)

    asyncio.run(main())


def test_what_a_person_types_goes_out_as_typed_and_comes_back_inert(opened, fake):
    async def see(screen):
        await screen.press("p")
        await screen.until(lambda: "pause" in fake.commands(), "the pause")
        assert fake.asked[-1] == Pause(reason="by the operator")

    _run(see, opened)


def test_a_rig_whose_name_is_long_keeps_the_run_beside_it(opened, fake):
    fake.rig = "the rig with a name that is longer than any screen is wide, because somebody wrote a sentence into it"

    async def see(screen):
        first = screen.bars.splitlines()[0]
        assert len(first) <= 80
        assert "RIG  the rig with a name" in first
        assert "two windows" in first

    _run(see, opened)


def test_files_aside_are_read_by_one_thread_at_a_time_and_their_errors_come_back(tmp_path):
    from fidim_lab.app.tui.aside import Aside

    async def main():
        aside = Aside(LoopClock())
        assert await aside.run(lambda: 7) == 7
        with pytest.raises(FileNotFoundError):
            await aside.run((Path(tmp_path) / "absent").read_bytes)

    asyncio.run(main())
