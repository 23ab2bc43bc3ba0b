"""Large figures for the hand at the platform, what the model check says, and the mouse where a key would do."""

import asyncio

import pytest

from fidim_lab.app.service.messages import Happening, Question
from fidim_lab.app.tui.paint import text_of
from fidim_lab.app.tui.result_files import ResultFiles
from fidim_lab.app.tui.screens.bars import KEYS, key_lines, prompt_lines, tab_lines
from fidim_lab.app.tui.screens.hand import ROWS, SHAPES, big, hand_lines
from fidim_lab.app.tui.screens.log import log_lines
from fidim_lab.app.tui.screens.why import check_lines, newest_check, why_lines
from fidim_lab.app.tui.view import Connection, ScreenState

ASKED = Question(
    number=1, kind="displace-and-release", window="i02", text="x", choices=("done", "skip"), displacement=(-0.02, 0.04)
)


@pytest.fixture
def asked(fake):
    """A hand that has come half the way."""
    mocap = fake.state.mocap.model_copy(update={"position": (1.09, -0.25, -0.308)})
    status = fake.state.model_copy(update={"mocap": mocap})
    return ScreenState(contact=Connection.LIVE, status=status, age=0.1, question=ASKED, rest=(1.1, -0.27, -0.31))


def shown(rows, axis, *figures):
    """Whether the figures stand side by side in the rows of this axis (0: the highest)."""
    top = 1 + axis * (ROWS + 1)
    texts = text_of(rows).splitlines()[top : top + ROWS]
    parts = [text_of(big(figure)).splitlines() for figure in figures]
    return all(all(part[k] in texts[k] for part in parts) for k in range(len(texts))) and len(texts) == ROWS


def test_wanted_and_present_place_stand_in_large_figures(asked):
    rows = hand_lines(asked, 18)
    assert "WANTED, mm" in text_of(rows[:1])
    assert "NOW, mm" in text_of(rows[:1])
    assert shown(rows, 0, "x", "-20", "-10")
    assert shown(rows, 1, "y", "+40", "+20")
    assert shown(rows, 2, "z", "+2")
    assert not shown(rows, 0, "-30")
    assert len(rows) <= 18
    assert max(len(row) for row in text_of(rows).splitlines()) <= 79


def test_figures_leave_room_for_what_there_is(asked):
    assert len(hand_lines(asked, 12)) == 12
    assert hand_lines(asked, 11) == []
    assert hand_lines(ScreenState(contact=Connection.LOST, question=ASKED), 30) == []
    assert "NOW" not in text_of(hand_lines(ScreenState(contact=Connection.LIVE, question=ASKED), 30))


def test_all_figures_have_one_size():
    assert all(len(shape) == ROWS and {len(row) for row in shape} == {4} for shape in SHAPES.values())
    assert text_of(big("*")) == text_of(big("?"))


def _checked(number, window, outcome, text):
    return Happening(
        number=number,
        t=0.0,
        wall="2026-01-02T10:11:12.000",
        kind="model-checked",
        window=window,
        outcome=outcome,
        text=text,
    )


def test_what_the_model_check_suspects_is_said_with_a_mark_on_three_screens():
    events = tuple(
        _checked(k, f"i0{k}", "holds" if k < 4 else "air-drag", "the model holds" if k < 4 else "suspected: air-drag")
        for k in range(1, 5)
    )
    [newest] = newest_check(events, 79)
    assert text_of([newest]) == "! model i04: suspected: air-drag"
    assert {span.style for span in newest} == {"warn"}
    assert text_of(newest_check(events[:3], 79)) == "model i03: the model holds"
    assert newest_check((), 79) == []
    assert text_of(check_lines(events, 79)).count("model i0") == 3  # the newest ones
    assert "suspected: air-drag" in text_of(why_lines(ResultFiles(), 79, checked=check_lines(events, 79)))
    assert "! model: suspected: air-drag" in text_of(log_lines(ScreenState(events=events), 79))


def test_before_there_is_enough_to_tell_the_model_check_is_faint_and_doubts_nothing():
    early = (_checked(1, "i01", "", "1 window so far: 3 are needed to check the model."),)
    [row] = newest_check(early, 79)
    assert text_of([row]) == "model i01: 1 window so far: 3 are needed to check the model."
    assert {span.style for span in row} == {"dim"}
    assert "  model: 1 window so far" in text_of(log_lines(ScreenState(events=early), 79))


def test_a_long_suspicion_is_cut_on_session_where_a_reader_sees_it_and_whole_on_why():
    says = "5 windows so far: χ²/dof 17.1 over the first 1 s; suspected: rotational-drag, " + "and more of it, " * 6
    events = (_checked(1, "v01", "rotational-drag", says + "to the end"),)
    rows = newest_check(events, 79)
    assert len(rows) == 2
    assert text_of(rows).endswith("…")
    assert all(len(row) <= 79 for row in text_of(rows).splitlines())
    assert "to the end" in text_of(check_lines(events, 79))


def test_each_key_below_is_a_button_and_all_fit_in_80_columns():
    [row] = key_lines(80)
    assert len(text_of([row])) <= 80
    assert {span.click for span in row if span.click} == {action for *_, action in KEYS}
    assert [span.click for span in tab_lines(0, 80)[0] if span.click][2] == "screen.turn(2)"
    assert "app.choose('d')" in [
        span.click for span in prompt_lines(ScreenState(contact=Connection.LIVE, question=ASKED), 80)[-1]
    ]


def test_a_click_turns_to_a_screen_answers_a_prompt_and_stops(opened, fake):
    async def use():
        async with opened() as screen:
            await screen.click("#tabs", (14, 0))
            await screen.until(lambda: "[2 Rig]" in screen.app.stage.tabs.text, "the rig")
            fake.ask()
            await screen.until(lambda: "[d] done" in screen.bars, "the prompt")
            row = screen.app.stage.prompt.text.splitlines().index("[d] done   [s] skip   [a] abort")
            await screen.until(lambda: screen.app.stage.prompt.region.height > row, "room for the prompt")
            await screen.click("#prompt", (1, row))
            await screen.until(lambda: "answer" in fake.commands(), "the answer")
            await screen.click("#keys", (1, 0))
            await screen.until(lambda: "e-stop" in fake.commands(), "the stop")

    asyncio.run(use())
