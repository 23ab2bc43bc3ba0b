from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from docs.tools.cia402 import page
from drivers.cia402.profile.machine import CONTROLWORD, PATTERNS, TRANSITIONS, Command, answer, next_command, state_of
from drivers.ports import DriveState

S, C = DriveState, Command
DRIVE_STATES = [p.state for p in PATTERNS]

# Written down from the standard a second time: where each command leads, per state; absent = ignored.
LEADS_TO = {
    S.NOT_READY: {},
    S.SWITCH_ON_DISABLED: {C.SHUTDOWN: S.READY},
    S.READY: {
        C.SWITCH_ON: S.SWITCHED_ON,
        C.DISABLE_VOLTAGE: S.SWITCH_ON_DISABLED,
        C.QUICK_STOP: S.SWITCH_ON_DISABLED,
    },
    S.SWITCHED_ON: {
        C.SHUTDOWN: S.READY,
        C.ENABLE_OPERATION: S.OPERATION_ENABLED,
        C.DISABLE_VOLTAGE: S.SWITCH_ON_DISABLED,
        C.QUICK_STOP: S.SWITCH_ON_DISABLED,
    },
    S.OPERATION_ENABLED: {
        C.SHUTDOWN: S.READY,
        C.DISABLE_OPERATION: S.SWITCHED_ON,
        C.DISABLE_VOLTAGE: S.SWITCH_ON_DISABLED,
        C.QUICK_STOP: S.QUICK_STOP_ACTIVE,
    },
    S.QUICK_STOP_ACTIVE: {C.DISABLE_VOLTAGE: S.SWITCH_ON_DISABLED, C.ENABLE_OPERATION: S.OPERATION_ENABLED},
    S.FAULT_REACTION: {},
    S.FAULT: {C.FAULT_RESET: S.SWITCH_ON_DISABLED},
}


@pytest.mark.parametrize("command", Command)
@pytest.mark.parametrize("state", DRIVE_STATES)
def test_every_pair(state: DriveState, command: Command) -> None:
    assert answer(state, command) is LEADS_TO[state].get(command)


def test_an_unknown_state_answers_nothing() -> None:
    assert all(answer(S.UNKNOWN, command) is None for command in Command)


def test_all_transitions_are_there_once() -> None:
    assert [t.number for t in TRANSITIONS] == list(range(17))


@pytest.mark.parametrize(
    ("statusword", "state"),
    [
        (0x0000, S.NOT_READY),
        (0x0240, S.SWITCH_ON_DISABLED),
        (0x0250, S.SWITCH_ON_DISABLED),
        (0x0270, S.SWITCH_ON_DISABLED),
        (0x0231, S.READY),
        (0x0233, S.SWITCHED_ON),
        (0x1637, S.OPERATION_ENABLED),
        (0x0617, S.QUICK_STOP_ACTIVE),
        (0x021F, S.FAULT_REACTION),
        (0x0218, S.FAULT),
        (0x0238, S.FAULT),
        (0x0201, S.UNKNOWN),
        (0x0235, S.UNKNOWN),
    ],
)
def test_statuswords_as_drives_send_them(statusword: int, state: DriveState) -> None:
    assert state_of(statusword) is state


@given(st.integers(0, 0xFFFF))
def test_a_statusword_means_at_most_one_state(statusword: int) -> None:
    fitting = [p.state for p in PATTERNS if statusword & p.mask == p.value]
    assert len(fitting) <= 1
    assert state_of(statusword) is (fitting[0] if fitting else S.UNKNOWN)


@pytest.mark.parametrize("state", DriveState)
def test_power_off_and_quick_stop_are_single_writes_from_everywhere(state: DriveState) -> None:
    if state is not S.SWITCH_ON_DISABLED:
        assert next_command(state, S.SWITCH_ON_DISABLED) is C.DISABLE_VOLTAGE
    if state is not S.QUICK_STOP_ACTIVE:
        assert next_command(state, S.QUICK_STOP_ACTIVE) is C.QUICK_STOP
    assert (CONTROLWORD[C.DISABLE_VOLTAGE], CONTROLWORD[C.QUICK_STOP]) == (0x00, 0x02)


@pytest.mark.parametrize("goal", [S.READY, S.SWITCHED_ON, S.OPERATION_ENABLED])
@pytest.mark.parametrize("start", [s for s in DRIVE_STATES if s not in (S.NOT_READY, S.FAULT, S.FAULT_REACTION)])
@pytest.mark.parametrize("holds", [False, True])
def test_the_way_leads_to_the_goal(start: DriveState, goal: DriveState, holds: bool) -> None:
    state, steps = start, 0
    while (command := next_command(state, goal, quick_stop_holds=holds)) is not None:
        reached = answer(state, command)
        assert reached is not None
        state, steps = reached, steps + 1
        assert steps <= 4
    assert state is goal


@pytest.mark.parametrize("goal", DriveState)
@pytest.mark.parametrize("state", DriveState)
@pytest.mark.parametrize("holds", [False, True])
def test_no_way_resets_a_fault_or_enables_on_the_way_down(state: DriveState, goal: DriveState, holds: bool) -> None:
    command = next_command(state, goal, quick_stop_holds=holds)
    assert command is not C.FAULT_RESET
    if goal is not S.OPERATION_ENABLED:
        assert command is not C.ENABLE_OPERATION
    if state in (S.FAULT, S.FAULT_REACTION, S.NOT_READY, S.UNKNOWN) and goal in (S.OPERATION_ENABLED, S.READY):
        assert command is None


def test_quick_stop_is_left_without_letting_go_only_where_the_drive_holds() -> None:
    assert next_command(S.QUICK_STOP_ACTIVE, S.OPERATION_ENABLED) is C.DISABLE_VOLTAGE
    assert next_command(S.QUICK_STOP_ACTIVE, S.OPERATION_ENABLED, quick_stop_holds=True) is C.ENABLE_OPERATION


def test_the_page_in_docs_is_current() -> None:
    file = Path(__file__).parents[4] / "docs" / "cia402.md"
    assert file.read_text(encoding="utf-8") == page(), "run: python -m docs.tools.cia402 docs/cia402.md"
