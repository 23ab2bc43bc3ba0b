"""The power state machine of CiA 402, seen from inside the drive: a controlword comes, a state follows.

Written from the standard's text (transition numbers in the comments), apart from the master's table on purpose.
"""

from enum import Enum


class State(Enum):
    """States; the value is the state's bits in the statusword."""

    NOT_READY = 0x00
    SWITCH_ON_DISABLED = 0x40
    READY = 0x21
    SWITCHED_ON = 0x23
    OPERATION_ENABLED = 0x27
    QUICK_STOP_ACTIVE = 0x07
    FAULT_REACTION = 0x0F
    FAULT = 0x08


def commanded(state: State, word: int, previous: int) -> State | None:
    """Where the controlword leads from `state` in one step; None: it changes nothing.

    `previous` is the controlword before, for the rising edge of fault reset. "Enable operation" is obeyed in READY as
    "switch on", so that calling again with the new state goes on to OPERATION ENABLED, as the standard has it. From
    QUICK STOP ACTIVE that word leads back (16); whether this drive may is for the caller to decide.
    """
    if state is State.FAULT:
        reset = word & 0x80 and not previous & 0x80
        return State.SWITCH_ON_DISABLED if reset else None  # 15
    if state in (State.NOT_READY, State.FAULT_REACTION):
        return None
    if state is State.SWITCH_ON_DISABLED:
        return State.READY if word & 0x07 == 0x06 else None  # 2
    if not word & 0x02:  # disable voltage: 7, 10, 9, 12
        return State.SWITCH_ON_DISABLED
    if not word & 0x04:  # quick stop: 7, 10, 11
        if state is State.QUICK_STOP_ACTIVE:
            return None
        return State.QUICK_STOP_ACTIVE if state is State.OPERATION_ENABLED else State.SWITCH_ON_DISABLED
    if state is State.QUICK_STOP_ACTIVE:
        return State.OPERATION_ENABLED if word & 0x0F == 0x0F else None  # 16
    if not word & 0x01:  # shutdown: 6, 8
        return None if state is State.READY else State.READY
    if state is State.READY:
        return State.SWITCHED_ON  # 3
    if word & 0x08:  # enable operation: 4
        return State.OPERATION_ENABLED if state is State.SWITCHED_ON else None
    return State.SWITCHED_ON if state is State.OPERATION_ENABLED else None  # 5
