"""Progress as a terminal and as a log shows it."""

import io
from pathlib import Path

import pytest
from rich.console import Console

from drivers.ports import Prompt, PromptKind
from fidim_lab.app.terminal.run_display import LiveDisplay, PlainDisplay, display
from procedures.events import (
    Event,
    Prompted,
    RunFinished,
    RunStarted,
    StepFinished,
    StepProgress,
    StepStarted,
    WindowFinished,
)
from procedures.outcomes import Outcome
from procedures.report import RunReport
from procedures.steps import CheckTension, Record, Result

RECORD = Record(window="i01", attempt=1, duration=10.0)
TENSIONS = CheckTension(window="i01", limits=(20.0, 200.0), tolerance=0.1, over=1.0)
PROMPT = Prompt(PromptKind.STEADY, "Bring [bold]it[/bold] to rest.")
REPORT = RunReport("r", Path(), Outcome.PASS, "", (), held=True, held_says="", seconds=70.0)
EVENTS: tuple[Event, ...] = (
    RunStarted(0.0, "r", ("i01", "i02"), 130.0, (110.0, 150.0)),
    StepStarted(1.0, 1, TENSIONS, 129.0),
    StepFinished(2.0, 1, TENSIONS, Result(values=(34.4, 71.2, 90.6)), 128.0),
    Prompted(3.0, "i01", PROMPT),
    StepStarted(9.0, 3, RECORD, 122.0),
    StepProgress(14.0, 3, RECORD, 0.5, 117.0),
    WindowFinished(19.0, "i01", Outcome.MARGINAL, "a tension was low", 1, 2),
)


def console(terminal: bool) -> tuple[Console, io.StringIO]:
    text = io.StringIO()
    return Console(file=text, force_terminal=terminal, width=120, color_system=None), text


def test_a_log_gets_a_line_for_each_thing_that_happens() -> None:
    out, text = console(terminal=False)
    with display(out, "dry run") as shown:
        assert isinstance(shown, PlainDisplay)
        for event in EVENTS:
            shown(event)
    said = text.getvalue()
    for expected in (
        "dry run: 2 windows; takes 0:01:50 to 0:02:30",
        "tensions 34–91 N",
        "? Bring [bold]it[/bold] to rest.",
        "recording  0:02:02 left",
        "~ marginal (1 of 2) a tension was low",
    ):
        assert expected in said


def test_the_same_reason_is_not_told_twice_in_a_row() -> None:
    out, text = console(terminal=False)
    failed = StepFinished(2.0, 1, RECORD, Result(Outcome.FAIL, "swings too little"), 128.0)
    with display(out, "dry run") as shown:
        for event in (EVENTS[0], failed, failed, EVENTS[3], failed):
            shown(event)
    assert text.getvalue().count("fail: swings too little") == 2


def test_a_terminal_gets_a_row_for_each_window() -> None:
    out, text = console(terminal=True)
    with display(out, "dry run") as shown:
        assert isinstance(shown, LiveDisplay)
        for event in EVENTS[:-1]:
            shown(event)
    said = text.getvalue()
    assert "i02" in said
    assert "recording" in said
    assert "█████·····" in said
    assert "0:01:57 left" in said
    assert "34–91" in said


@pytest.mark.parametrize("terminal", [True, False])
def test_the_end_leaves_the_verdicts(terminal: bool) -> None:
    out, text = console(terminal)
    with display(out, "dry run") as shown:
        for event in (*EVENTS, RunFinished(20.0, REPORT)):
            shown(event)
    assert "~ marginal" in text.getvalue()
