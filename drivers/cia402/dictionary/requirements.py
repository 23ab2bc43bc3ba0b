"""What a drive must have before it may move a winch, in grades, and how one drive meets each. Pure.

`REQUIREMENTS` is the one list. What a drive cannot be told (`Grade.PROVEN`) is proven by trial: a `TrialPassed` in
`WinchConfig.proofs`, which `met_by_trial` looks up. `Graded` is one line of the table that doctor and report show.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum

from drivers.ports import Trial


class Grade(StrEnum):
    """How much a requirement matters."""

    MUST = "must have"
    PROVEN = "must have, or be proven by trial"
    GOOD = "good to have"


class Met(StrEnum):
    """How a drive meets a requirement."""

    CONFIGURED = "configured"
    """written to the drive and read back, or told by it"""
    TRIAL = "proven by trial"
    HOST = "by the host"
    """the drive lacks it; `Requirement.instead` takes its place"""
    ABSENT = "absent"
    """neither the drive nor a trial nor the host: refused"""


@dataclass(frozen=True)
class TrialPassed:
    """A trial that a drive has passed: it stood still, within a time and a way that were measured."""

    trial: Trial
    serial_number: int
    """1018:4 of the drive that was tried; 0: it has none"""
    speed: float
    """m/s of cable at which it was tried"""
    time: float
    """s from what was withheld or commanded to standstill"""
    distance: float
    """m of cable in that time"""
    by: str = ""
    """who was there"""
    at: str = ""
    """date and time, ISO 8601"""
    faulted: bool = False
    """nobody commanded the stop, and the drive was in fault afterwards: its fault reaction has stopped it"""


@dataclass(frozen=True)
class Requirement:
    """One of them."""

    key: str
    grade: Grade
    objects: tuple[tuple[str, ...], ...]
    """alternatives; each is a set of objects ("605A:0") that together meet it"""
    instead: str = ""
    """what takes its place where the drive lacks it; empty: nothing, such a drive is refused"""
    trials: tuple[Trial, ...] = ()
    """any of them proves it"""
    cure: str = "is it the EDS file of its firmware?"
    """what to do about a drive that is refused for it"""
    by_fault: bool = False
    """so does every trial that the drive has ended in fault by itself"""


_MUST, _PROVEN, _GOOD = Grade.MUST, Grade.PROVEN, Grade.GOOD
REQUIREMENTS: tuple[Requirement, ...] = (
    Requirement("state machine", _MUST, (("6040:0", "6041:0"),)),
    Requirement("position actual value", _MUST, (("6064:0",),)),
    Requirement("position command", _MUST, (("6060:0", "6061:0", "607A:0"),)),
    Requirement(
        "samples at each SYNC",
        _MUST,
        (),
        cure=(
            "map them with the maker's tool, of transmission type 1, and give the DCF that it saves, or ask for "
            "firmware that can be mapped"
        ),
    ),
    Requirement(
        "reaction to a lost host",
        _PROVEN,
        (("1016:1", "6007:0"), ("100C:0", "100D:0", "6007:0")),
        trials=(Trial.LOST_HEARTBEAT, Trial.LOST_SYNC),
    ),
    Requirement("quick-stop reaction", _PROVEN, (("605A:0", "6085:0"),), trials=(Trial.QUICK_STOP,)),
    Requirement("halt reaction", _PROVEN, (("605D:0",),), trials=(Trial.HALT,)),
    Requirement("fault reaction", _PROVEN, (("605E:0",),), trials=(Trial.FOLLOWING_ERROR,), by_fault=True),
    Requirement(  # where 6065 cannot be written no trial can be made either
        "following-error limit",
        _PROVEN,
        (("6065:0",),),
        "the motion guard compares encoder and command",
        trials=(Trial.FOLLOWING_ERROR,),
    ),
    Requirement("position limits", _GOOD, (("607D:1", "607D:2"),), "each target is checked; smaller allowed area"),
    Requirement("speed limit", _GOOD, (("607F:0",),), "each move's speed is checked, and the motion guard watches it"),
    Requirement("current limit", _GOOD, (("6073:0",), ("6072:0",)), "the tension guard stops"),
    Requirement("separate deceleration", _GOOD, (("6084:0",),), "6083 is for both ramps"),
    Requirement("following-error time", _GOOD, (("6066:0",),), "the drive's own"),
    Requirement("communication error", _GOOD, (("1029:1",),), "the drive's own; samples that stop are seen"),
    Requirement("load reported", _GOOD, (), "no run is possible, since the tension would be unknown"),
    Requirement(
        "heartbeat of the drive", _GOOD, (("1017:0",), ("100C:0",)), "its samples at each SYNC show that it works"
    ),
    Requirement("following error reported", _GOOD, (("60F4:0",),), "the motion guard compares encoder and command"),
    Requirement("rated current", _GOOD, (("6075:0",),), "the value of the rig file is used"),
    Requirement("supported modes", _GOOD, (("6502:0",),), "the displayed mode (6061) counts"),
    Requirement("serial number", _GOOD, (("1018:4",),), "the first moves show exchanged drives"),
    Requirement("jerk limit", _GOOD, (("60A4:1",), ("6086:0",)), "ramps are trapezoids"),
)
"""6502 and all other values are compared with the drive where they are there; `grading` grades one drive"""


@dataclass(frozen=True)
class Graded:
    """How one drive meets one requirement."""

    requirement: Requirement
    met: Met
    found: str
    """objects that are there or not, the trial, or both"""
    proof: TrialPassed | None = None

    @property
    def refused(self) -> bool:
        """Whether no winch may be moved by this drive, except in a trial."""
        return self.met is Met.ABSENT


def met_by_trial(requirement: Requirement, proofs: Iterable[TrialPassed], serial_number: int) -> TrialPassed | None:
    """The newest proof of this requirement for the drive with this serial number (1018:4; 0: it has none)."""
    ours = (proof for proof in proofs if proof.serial_number == serial_number)
    found = [p for p in ours if p.trial in requirement.trials or (requirement.by_fault and p.faulted)]
    return max(found, key=lambda proof: proof.at, default=None)
