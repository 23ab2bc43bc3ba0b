"""The CiA 402 drive machine as data: states, commands, all 16 transitions. No I/O, no time.

`state_of` reads a statusword, `answer` says where a command leads, `next_command` which one to send next on the way to
a goal. Power-off and quick stop are one single write from anywhere; a fault reset is on no way to any goal.
`docs/cia402.md` is generated from these tables (`diagram.py`).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType

from drivers.ports import DriveState


class Command(StrEnum):
    """The commands of a controlword to the state machine."""

    SHUTDOWN = "shutdown"
    SWITCH_ON = "switch on"
    ENABLE_OPERATION = "enable operation"
    DISABLE_OPERATION = "disable operation"
    DISABLE_VOLTAGE = "disable voltage"
    QUICK_STOP = "quick stop"
    FAULT_RESET = "fault reset"


CONTROLWORD: Mapping[Command, int] = MappingProxyType(
    {
        Command.SHUTDOWN: 0x06,
        Command.SWITCH_ON: 0x07,
        Command.ENABLE_OPERATION: 0x0F,
        Command.DISABLE_OPERATION: 0x07,
        Command.DISABLE_VOLTAGE: 0x00,
        Command.QUICK_STOP: 0x02,
        Command.FAULT_RESET: 0x80,
    }
)
"""Object 6040, bits 0-3 and 7. The fault reset acts on the rising edge of bit 7."""


@dataclass(frozen=True)
class StatusPattern:
    """A state and the bits of object 6041 that mean it."""

    mask: int
    value: int
    state: DriveState


PATTERNS = (
    StatusPattern(0x4F, 0x00, DriveState.NOT_READY),
    StatusPattern(0x4F, 0x40, DriveState.SWITCH_ON_DISABLED),
    StatusPattern(0x6F, 0x21, DriveState.READY),
    StatusPattern(0x6F, 0x23, DriveState.SWITCHED_ON),
    StatusPattern(0x6F, 0x27, DriveState.OPERATION_ENABLED),
    StatusPattern(0x6F, 0x07, DriveState.QUICK_STOP_ACTIVE),
    StatusPattern(0x4F, 0x0F, DriveState.FAULT_REACTION),
    StatusPattern(0x4F, 0x08, DriveState.FAULT),
)
"""No statusword fits two of these; one that fits none is UNKNOWN."""

_STATE_BITS = 0x6F
_STATE_OF: tuple[DriveState, ...] = tuple(
    next((p.state for p in PATTERNS if bits & p.mask == p.value), DriveState.UNKNOWN) for bits in range(_STATE_BITS + 1)
)


def state_of(statusword: int) -> DriveState:
    """The state that a statusword (object 6041) means; UNKNOWN where it means none."""
    return _STATE_OF[statusword & _STATE_BITS]


@dataclass(frozen=True)
class Transition:
    """One numbered transition of the standard; without commands it happens by itself."""

    number: int
    source: DriveState | None
    """None is any state (13), or the start (0)"""
    target: DriveState
    commands: tuple[Command, ...] = ()
    note: str = ""


_S, _C = DriveState, Command
TRANSITIONS = (
    Transition(0, None, _S.NOT_READY, note="start"),
    Transition(1, _S.NOT_READY, _S.SWITCH_ON_DISABLED, note="self-test done"),
    Transition(2, _S.SWITCH_ON_DISABLED, _S.READY, (_C.SHUTDOWN,)),
    Transition(3, _S.READY, _S.SWITCHED_ON, (_C.SWITCH_ON,)),
    Transition(4, _S.SWITCHED_ON, _S.OPERATION_ENABLED, (_C.ENABLE_OPERATION,)),
    Transition(5, _S.OPERATION_ENABLED, _S.SWITCHED_ON, (_C.DISABLE_OPERATION,)),
    Transition(6, _S.SWITCHED_ON, _S.READY, (_C.SHUTDOWN,)),
    Transition(7, _S.READY, _S.SWITCH_ON_DISABLED, (_C.DISABLE_VOLTAGE, _C.QUICK_STOP)),
    Transition(8, _S.OPERATION_ENABLED, _S.READY, (_C.SHUTDOWN,)),
    Transition(9, _S.OPERATION_ENABLED, _S.SWITCH_ON_DISABLED, (_C.DISABLE_VOLTAGE,)),
    Transition(10, _S.SWITCHED_ON, _S.SWITCH_ON_DISABLED, (_C.DISABLE_VOLTAGE, _C.QUICK_STOP)),
    Transition(11, _S.OPERATION_ENABLED, _S.QUICK_STOP_ACTIVE, (_C.QUICK_STOP,)),
    Transition(12, _S.QUICK_STOP_ACTIVE, _S.SWITCH_ON_DISABLED, (_C.DISABLE_VOLTAGE,), "by itself if 605A is 0 to 4"),
    Transition(13, None, _S.FAULT_REACTION, note="a fault, from any state"),
    Transition(14, _S.FAULT_REACTION, _S.FAULT, note="reaction done"),
    Transition(15, _S.FAULT, _S.SWITCH_ON_DISABLED, (_C.FAULT_RESET,)),
    Transition(16, _S.QUICK_STOP_ACTIVE, _S.OPERATION_ENABLED, (_C.ENABLE_OPERATION,), "only if 605A is 5 to 8"),
)

ANSWERS: Mapping[tuple[DriveState, Command], DriveState] = MappingProxyType(
    {(t.source, c): t.target for t in TRANSITIONS if t.source is not None for c in t.commands}
)
"""The legal (state, command) pairs and where they lead; a drive ignores every other pair."""


def answer(state: DriveState, command: Command) -> DriveState | None:
    """The state that `command` leads to from `state`; None where the drive ignores it."""
    return ANSWERS.get((state, command))


WAYS: Mapping[DriveState, Mapping[DriveState, Command]] = MappingProxyType(
    {
        _S.OPERATION_ENABLED: {
            _S.SWITCH_ON_DISABLED: _C.SHUTDOWN,
            _S.READY: _C.SWITCH_ON,
            _S.SWITCHED_ON: _C.ENABLE_OPERATION,
            _S.QUICK_STOP_ACTIVE: _C.DISABLE_VOLTAGE,
        },
        _S.SWITCHED_ON: {
            _S.SWITCH_ON_DISABLED: _C.SHUTDOWN,
            _S.READY: _C.SWITCH_ON,
            _S.OPERATION_ENABLED: _C.DISABLE_OPERATION,
            _S.QUICK_STOP_ACTIVE: _C.DISABLE_VOLTAGE,
        },
        _S.READY: {
            _S.SWITCH_ON_DISABLED: _C.SHUTDOWN,
            _S.SWITCHED_ON: _C.SHUTDOWN,
            _S.OPERATION_ENABLED: _C.SHUTDOWN,
            _S.QUICK_STOP_ACTIVE: _C.DISABLE_VOLTAGE,
        },
    }
)
"""goal → (state → next command). There is no way out of a fault: that takes a person (FAULT_RESET)."""

_SINGLE_WRITES = {_S.SWITCH_ON_DISABLED: _C.DISABLE_VOLTAGE, _S.QUICK_STOP_ACTIVE: _C.QUICK_STOP}


def next_command(state: DriveState, goal: DriveState, *, quick_stop_holds: bool = False) -> Command | None:
    """The command to send next on the way from `state` to `goal`; None where there is nothing to send.

    None means: arrived, or the drive must move first by itself, or only an acknowledged fault reset can help.
    Power off (goal SWITCH_ON_DISABLED) and quick stop are the same single command from every state, known or not: a
    quick stop from READY must never enable first. `quick_stop_holds` (605A is 5 to 8) allows transition 16, so that a
    drive that holds its load in quick stop is not let go on the way back to OPERATION_ENABLED.
    """
    if state is goal:
        return None
    if goal in _SINGLE_WRITES:
        return _SINGLE_WRITES[goal]
    if quick_stop_holds and (state, goal) == (_S.QUICK_STOP_ACTIVE, _S.OPERATION_ENABLED):
        return _C.ENABLE_OPERATION
    return WAYS.get(goal, {}).get(state)
