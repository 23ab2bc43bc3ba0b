"""Each state as a person meets it: the real application at 80 × 24, against a service on a real socket."""

import asyncio

import pytest

from fidim_lab.app.service.commands import AnswerPrompt, Reset
from fidim_lab.app.service.messages import Bye, GuardState, Happening
from fidim_lab.app.tui.screens.bars import TABS


async def _settled(screen):
    await screen.until(lambda: "[d] done" in screen.bars, "the prompt")


def _run(coroutine_function, opened, **more):
    async def main():
        async with opened(**more) as screen:
            await coroutine_function(screen)

    asyncio.run(main())


def test_running_shows_the_step_and_every_equilibrium(opened):
    async def see(screen):
        assert "▶ RUNNING" in screen.bars
        assert "record 10 s" in screen.board
        assert "40 %" in screen.board
        assert "left 12:34" in screen.board
        assert "~ marginal" in screen.board
        assert "amplitude 41 mm is near the least" in screen.board
        assert "▶ i02" in screen.board

    _run(see, opened)


def test_every_screen_by_number_fits_80_by_24_and_has_help(opened):
    async def see(screen):
        for index, name in enumerate(TABS):
            await screen.press(str(index + 1))
            assert f"[{index + 1} {name}]" in screen.app.stage.tabs.text
            assert all(len(row) <= 80 for row in screen.board.splitlines())
            await screen.press("question_mark")
            assert "EMERGENCY STOP: all winches at once" in screen.over
            assert name in screen.over
            await screen.press("escape")

    _run(see, opened)


@pytest.mark.parametrize("light", [False, True])
def test_both_themes_are_there_and_the_palette_changes_them(opened, light):
    async def see(screen):
        first = screen.app.theme
        assert first == ("fidim-light" if light else "fidim-dark")
        other = next(c for c in screen.app.get_system_commands(screen.app.screen) if c.title == "light or dark")
        other.callback()
        await screen.pilot.pause()
        assert screen.app.theme != first

    _run(see, opened, light=light)


def test_the_palette_names_every_order(opened):
    async def see(screen):
        titles = [command.title for command in screen.app.get_system_commands(screen.app.screen)]
        assert {"E-STOP", "reset", "go", "pause", "abort", "identify", "screen Rig"} <= set(titles)

    _run(see, opened)


def test_a_prompt_is_answered_by_one_key_from_any_screen(opened):
    async def see(screen):
        await screen.press("2")
        screen.service.ask()
        await screen.until(lambda: "[d] done" in screen.bars, "the prompt")
        assert "Displace the platform" in screen.bars
        assert "x -20 mm  y +40 mm" in screen.bars
        await _settled(screen)
        await screen.press("d")
        await screen.until(lambda: screen.service.asked, "the answer")
        assert screen.service.asked == [AnswerPrompt(prompt=1, choice="done")]
        await screen.until(lambda: "[d] done" not in screen.bars, "the prompt's end")

    _run(see, opened)


def test_a_key_that_was_meant_for_what_was_there_before_answers_nothing(opened, monkeypatch):
    monkeypatch.setattr("fidim_lab.app.tui.app.SETTLE", 60.0)

    async def see(screen):
        screen.service.ask()
        await screen.until(lambda: screen.app.link.view().question is not None, "the question")
        await screen.pilot.press("d")
        await screen.pilot.pause(0.1)
        assert screen.service.asked == []

    _run(see, opened)


def test_a_letter_typed_into_the_filter_answers_no_prompt(opened):
    async def see(screen):
        screen.service.ask()
        await _settled(screen)
        await screen.press("slash", "d", "s")
        assert screen.app.stage.filter.value == "ds"
        assert screen.service.asked == []

    _run(see, opened)


def test_the_latch_is_unmistakable_without_colour_also_in_a_dialog(opened):
    async def see(screen):
        await screen.press("f12")
        await screen.until(lambda: "E M E R G E N C Y   S T O P   L A T C H E D" in screen.bars, "the latch")
        assert "by the test" in screen.bars
        await screen.press("question_mark")
        await screen.until(lambda: "L A T C H E D" in screen.over, "the latch over the help")

    _run(see, opened)


def test_reset_needs_two_steps_and_no_leaves_it_latched(opened, fake):
    fake.become(latched=True, latched_why="by hand")

    async def see(screen):
        await screen.press("r")
        await screen.until(lambda: "Reset the emergency stop?" in screen.over, "the question")
        assert "by hand" in screen.over
        await screen.press("n")
        assert fake.state.latched
        await screen.press("r")
        await screen.until(lambda: "Reset the emergency stop?" in screen.over, "the question")
        assert "Has its cause been removed?" in screen.over
        await screen.press("y")
        await screen.until(lambda: "Is nobody near the platform and cables?" in screen.over, "the second question")
        assert fake.state.latched
        await screen.press("y")
        await screen.until(lambda: not fake.state.latched, "the reset")
        assert fake.asked[-1] == Reset(code="7319")

    _run(see, opened)


def test_a_stop_that_nobody_answers_sends_to_the_hardware_stop(opened, fake):
    fake.deaf = True

    async def see(screen):
        await screen.press("f12")
        await screen.until(lambda: "PRESS THE HARDWARE STOP" in screen.bars, "that it is not confirmed")

    _run(see, opened)


def test_a_lost_service_is_said_and_no_value_is_shown_as_fresh_then_it_attaches_again(opened, fake):
    async def see(screen):
        await screen.press("2")
        screen.kill_service()
        await screen.until(lambda: "SERVICE LOST" in screen.bars, "the loss")
        await screen.until(lambda: "OLD" in screen.bars and "SECONDS" not in screen.bars, "the age")
        assert "live" not in screen.bars
        lines = screen.app.stage.boards[1]._lines
        assert {span.style for row in lines for span in row} == {"old"}
        await screen.press("f12")
        await screen.until(lambda: "PRESS THE HARDWARE STOP" in screen.bars, "that nothing was stopped")
        screen.start_service()
        await screen.until(lambda: "● live" in screen.bars, "the service again")
        assert "SERVICE LOST" not in screen.bars

    _run(see, opened)


def test_a_service_that_goes_silent_is_not_called_live(opened, fake):
    async def see(screen):
        fake.silent = True
        await screen.until(lambda: "SERVICE DOES NOT ANSWER" in screen.bars, "the silence")
        assert "✗ OLD" in screen.bars

    _run(see, opened)


def test_a_service_that_says_goodbye_has_ended_and_is_not_lost(opened, fake):
    async def see(screen):
        fake.say(Bye(says="run pass: all windows are judged.", exit_code=0))
        await screen.pilot.pause(0.1)
        screen.kill_service()
        await screen.until(lambda: "THE SERVICE HAS ENDED" in screen.bars, "the end")
        assert "all windows are judged" in screen.bars
        assert "LOST" not in screen.bars

    _run(see, opened)


def test_a_fault_names_winch_and_guard_with_the_reason(opened, fake):
    fake.become(
        phase="stopping",
        winches=fake.winches(drive="fault", fault="0x7500 communication (heartbeat)", age=2.4),
        guards=(
            GuardState(name="stale winch", state="tripped", reaction="quick stop", why="winch 1: silent for 2.4 s"),
        ),
    )

    async def see(screen):
        await screen.press("2")
        assert "■ STOPPING" in screen.bars
        assert "✗ fault" in screen.board
        assert "0x7500" in screen.board
        assert "OLD VALUES: 2." in screen.board
        assert "✗ TRIPPED" in screen.board
        assert "winch 1: silent for 2.4 s" in screen.board

    _run(see, opened)


def test_abort_asks_and_skip_wants_a_reason(opened, fake):
    async def see(screen):
        await screen.press("x")
        assert "Abort the run?" in screen.over
        await screen.press("n")
        assert fake.commands() == []
        await screen.press("k")
        await screen.press("enter")
        await screen.until(lambda: "skip" in fake.commands(), "the skip")
        assert fake.asked[-1].reason == "by the operator"

    _run(see, opened)


def test_command_is_taken_from_another_client_only_after_a_question(opened, fake):
    fake.become(commanding=77)

    async def see(screen):
        await screen.press("p")
        assert "client #77 commands the robot now" in screen.over
        await screen.press("n")
        assert fake.commands() == []
        await screen.press("p", "y")
        await screen.until(lambda: fake.commands() == ["take-lease", "pause"], "both commands")

    _run(see, opened)


def test_the_log_has_a_filter(opened, fake):
    fake.events = [
        Happening(number=k, t=float(k), wall="2026-01-02T10:11:12", kind=kind, text=text)
        for k, (kind, text) in enumerate([("run-started", "two windows"), ("guard-warned", "marker")], start=1)
    ]

    async def see(screen):
        await screen.press("6")
        assert "two windows" in screen.board
        await screen.press("slash", *"guard")
        await screen.until(lambda: "two windows" not in screen.board, "the filter")
        assert "marker" in screen.board
        await screen.press("escape")
        await screen.until(lambda: "two windows" in screen.board, "all again")

    _run(see, opened)


def test_leaving_asks_nothing_of_the_service(opened, fake):
    async def see(screen):
        await screen.press("q")
        await screen.pilot.pause(0.1)

    _run(see, opened)
    assert fake.commands() == []
