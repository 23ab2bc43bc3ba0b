"""A terminal of 50 × 12, as Pilot sees it: what must be read is in sight in the screen and over it."""

import asyncio

import pytest

from fidim_lab.app.service.messages import Bye, Question
from fidim_lab.app.tui.paint import text_of
from fidim_lab.app.tui.screens.bars import prompt_lines
from fidim_lab.app.tui.view import Connection, ScreenState

SIZE = (50, 12)
TITLE = "EMERGENCY STOP LATCHED"


def seen(screen) -> list[str]:
    """The rows of the terminal, as they are drawn."""
    widths = screen.app.screen._compositor.render_strips()
    return ["".join(segment.text for segment in strip) for strip in widths]


def run(see, opened, size=SIZE):
    async def main():
        async with opened(size) as screen:
            await see(screen)

    asyncio.run(main())


async def drawn(screen, text):
    await screen.until(lambda: any(text in row for row in seen(screen)), f"{text!r} in sight")


@pytest.mark.sampled(9)
@pytest.mark.parametrize("size", [SIZE, (44, 12), (80, 24)])
@pytest.mark.parametrize(("key", "must"), [("x", "[y]"), ("k", "[Enter]"), ("question_mark", "The present step")])
@pytest.mark.parametrize("state", ["running", "latched", "prompt"])
def test_a_dialog_shows_its_question_and_answers_without_scrolling(opened, key, must, state, size):
    async def see(screen):
        if state == "latched":
            screen.service.become(latched=True, latched_why="by hand")
            await drawn(screen, TITLE if size[0] < 60 else "E M E R G E N C Y")
        if state == "prompt":
            screen.service.ask()
            await drawn(screen, "ANSWER THIS")
        await screen.keys(key)
        await screen.until(lambda: len(screen.app.screen_stack) > 1, "the dialog")
        await drawn(screen, must)
        if state == "latched":
            await drawn(screen, TITLE if size[0] < 60 else "E M E R G E N C Y")
        assert max(map(len, seen(screen))) <= size[0]
        await screen.keys("escape")

    run(see, opened, size)


@pytest.mark.parametrize("width", [40, 50, 80])
def test_a_prompt_is_whole_at_any_width(fake, width):
    """Both ways from rest, and every choice, on as many lines as they need."""
    asked = Question(
        number=1,
        kind="displace-and-release",
        window="i02",
        text="Displace the platform, keep it still, and let go.",
        choices=("done", "skip", "abort"),
        displacement=(-0.026, 0.054),
        default="skip",
        default_after=60.0,
    )
    mocap = fake.state.mocap.model_copy(update={"position": (0.112, 0.134, 1.5)})
    status = fake.state.model_copy(update={"mocap": mocap})
    view = ScreenState(contact=Connection.LIVE, status=status, age=0.0, question=asked, rest=(0.1, 0.2, 1.5), now=10.0)
    rows = text_of(prompt_lines(view, width)).splitlines()
    said = "\n".join(rows)
    assert max(map(len, rows)) <= width
    assert "displace by  x -26 mm  y +54 mm" in said
    assert "NOW  x +12 mm  y -66 mm" in said
    assert all(f"[{choice[0]}] {choice}" in said for choice in asked.choices)
    assert "“skip” automatically in 50 s" in said


@pytest.mark.parametrize("measured", ["All winches stand still, held.", "Winch 2 still moves: cut its power by hand."])
@pytest.mark.parametrize("size", [SIZE, (80, 24)])
def test_what_was_measured_at_the_end_is_in_sight_under_a_latched_stop(opened, measured, size):
    """After F12 the stop, who pressed it, and the end of the run share seven lines, and a sentence is longer."""
    why = "emergency stop by fidim ui #3: key (2026-11-26 13:40:52 UTC)"
    step = "wait until the marker moves less than 2 mm peak to peak in 1 s (at most 8 s)"

    async def see(screen):
        screen.service.become(phase="ended", latched=True, latched_why=why)
        await drawn(screen, "The run has ended")
        screen.service.say(
            Bye(
                says=f"run error: The emergency stop guard stopped the run: {why}. It was at “{step}”. {measured}",
                exit_code=3,
            )
        )
        await screen.pilot.pause(0.1)
        screen.kill_service()
        await drawn(screen, measured)
        await drawn(screen, "The run has ended")

    run(see, opened, size)
