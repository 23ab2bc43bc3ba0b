"""Statusword, controlword and modes beyond the drive machine: the bits of profile position mode (CiA 402). Pure."""

from enum import IntEnum

from drivers.cia402.profile.machine import CONTROLWORD, Command


class Mode(IntEnum):
    """Modes of operation (objects 6060 and 6061); bit `mode - 1` of 6502 says whether a drive has it."""

    NONE = 0
    PROFILE_POSITION = 1
    PROFILE_VELOCITY = 3
    PROFILE_TORQUE = 4
    HOMING = 6
    INTERPOLATED_POSITION = 7
    CYCLIC_POSITION = 8
    CYCLIC_VELOCITY = 9
    CYCLIC_TORQUE = 10


def mode_name(value: int) -> str:
    """A mode in words, also for numbers that the profile does not name."""
    try:
        return f"{Mode(value).name.lower().replace('_', ' ')} ({value})"
    except ValueError:
        return f"mode {value}"


# statusword 6041
VOLTAGE_ENABLED = 1 << 4
REMOTE = 1 << 9
TARGET_REACHED = 1 << 10
SET_POINT_ACKNOWLEDGED = 1 << 12
FOLLOWS = 1 << 12
"""in cyclic modes: the drive follows the command value"""
_REMARKS = (
    (1 << 7, "with a warning"),
    (1 << 11, "at an internal limit"),
    (1 << 13, "with a following error"),
)


LOST = {
    VOLTAGE_ENABLED: "it has lost the supply voltage of its power stage (statusword bit 4)",
    REMOTE: "it takes no more commands from the bus (statusword bit 9, remote, is lost)",
}
"""what it means that a drive with power, which has shown this bit, does not any more"""


def remarks(statusword: int) -> list[str]:
    """Remarks on a statusword besides its state, for a person, in profile position mode."""
    found = [words for bit, words in _REMARKS if statusword & bit]
    return found if statusword & VOLTAGE_ENABLED else [*found, "no supply voltage at the power stage"]


# controlword 6040
_NEW_SET_POINT = 1 << 4
_CHANGE_IMMEDIATELY = 1 << 5
HALT = 1 << 8


def controlword(command: Command, *, halt: bool = False) -> int:
    """The controlword of a drive-machine command, with the halt bit where asked."""
    return CONTROLWORD[command] | (HALT if halt else 0)


def set_point(*, new: bool, halt: bool = False) -> int:
    """The controlword of profile position mode with power on, absolute, "change immediately".

    A drive takes the target at the rising edge of bit 4 (`new`) and says so with statusword bit 12.
    """
    word = CONTROLWORD[Command.ENABLE_OPERATION] | _CHANGE_IMMEDIATELY
    return word | (_NEW_SET_POINT if new else 0) | (HALT if halt else 0)
