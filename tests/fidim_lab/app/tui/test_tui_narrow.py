"""Narrow terminals lose words, never the ends of lines; plots; skipped windows; who commands; why a run ended."""

from dataclasses import replace

import pytest

from fidim_lab.app.service.messages import EquilibriumState, Happening
from fidim_lab.app.tui.main_screen import help_lines
from fidim_lab.app.tui.paint import text_of
from fidim_lab.app.tui.screens.bars import TABS, key_lines, state_lines, tab_lines
from fidim_lab.app.tui.screens.log import log_lines
from fidim_lab.app.tui.screens.plot import QUANTITIES, plot_lines
from fidim_lab.app.tui.screens.rig import rig_lines
from fidim_lab.app.tui.screens.session import session_lines
from fidim_lab.app.tui.screens.window import window_lines
from fidim_lab.app.tui.view import Connection, ScreenState

WIDTH = 50


@pytest.fixture
def view(fake):
    """A run that a person has skipped two windows of."""
    rows = [EquilibriumState(window=f"i{k:02}", role="identify", state="done", verdict="skipped") for k in (1, 2)]
    rows.append(
        EquilibriumState(window="v01", role="validate", state="done", verdict="pass", attempts=1, amplitude=0.04)
    )
    fake.become(equilibria=tuple(rows), commanding=2, commander="fidim run #2")
    states = tuple(fake.state.model_copy(update={"t": 0.1 * k}) for k in range(300))
    return ScreenState(contact=Connection.LIVE, status=fake.state, age=0.0, states=states)


def test_a_narrow_terminal_clips_nothing(view):
    shown = {
        "state": state_lines(view, WIDTH),
        **{f"tabs {k}": tab_lines(k, WIDTH) for k in range(len(TABS))},
        "keys": key_lines(WIDTH),
        "session": session_lines(view, WIDTH, 12),
        "rig": rig_lines(view, WIDTH),
        "window": window_lines(view, WIDTH, 8, None),
        "log": log_lines(view, WIDTH, ""),
        "help": help_lines(0, WIDTH - 8),
        **{f"plot {k}": plot_lines(view, WIDTH, 9, k) for k in range(len(QUANTITIES))},
    }
    for name, rows in shown.items():
        for row in text_of(rows).splitlines():
            assert len(row) <= WIDTH, f"{name}: {row}"


def test_the_stop_and_the_help_are_the_last_keys_to_go():
    said = text_of(key_lines(24))
    assert said.startswith("F12 E-STOP")
    assert said.endswith("? help")


def test_skipped_windows_are_not_done(view):
    said = text_of(session_lines(view, 80))
    assert "1/3 windows, 2 skipped" in said
    assert "i01     identify  skipped" in said


def test_who_commands_is_named(view):
    assert "fidim run #2 commands, t takes over" in text_of(state_lines(view, 80))


def test_session_tells_why_a_run_ended_to_the_last_word(view):
    why = " ".join(f"winch {k} (node {k}): the drive has power already." for k in range(1, 5)) + " Secure the load."
    event = Happening(number=1, t=0.0, wall="", kind="run-finished", text="", outcome="error", reason=why)
    ended = replace(view, events=(event,), status=view.status.model_copy(update={"phase": "ended"}))
    said = " ".join(text_of(session_lines(ended, WIDTH)).split())
    assert f"✗ error: {why}" in said


def test_each_quantity_has_a_curve_for_each_winch_or_says_that_it_is_not_reported(view):
    for which, quantity in enumerate(QUANTITIES):
        said = text_of(plot_lines(view, 80, 20, which))
        assert quantity.name in said
        for name in quantity.of(view.status):
            assert name in said
    assert "−30 s" in said
