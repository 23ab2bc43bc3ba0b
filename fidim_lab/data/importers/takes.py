"""What an importer of many takes returns: one robot, and for each take its markers and, where there is one, its log.

Frozen values in SI units. Nothing is estimated here: which axis is up, which marker is which and where the motion is
free is found for all kinds alike by `fidim_lab.app.records.import_takes`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from fidim_lab.arrays import CableSeries, Series
from fidim_lab.data.importers.recording import MarkerLog
from fidim_lab.data.records import Robot, Role


@dataclass(frozen=True, eq=False)
class EncoderLog:
    """What a robot's controller logged while a take was recorded, in its own time base."""

    source: Path
    t: Series
    """s, increasing; the robot's clock"""
    lengths: CableSeries
    """(K, n) cable lengths from the encoders, m, each with an unknown constant; NaN where not logged"""
    swivels: CableSeries | None = None
    """(K, n) swivel angles, rad, each with an unknown constant"""
    currents: CableSeries | None = None
    """(K, n) motor currents, A"""
    decided: tuple[str, ...] = ()
    """what was decided while reading, a sentence each"""


@dataclass(frozen=True, eq=False)
class Take:
    """One file of motion capture with what belongs to it."""

    id: str
    markers: MarkerLog
    log: EncoderLog | None = None
    role: Role | None = None
    """what its windows are for, where the source says so"""


@dataclass(frozen=True)
class Asked:
    """What the caller said because a file does not, or says it wrongly."""

    up: str | None = None
    """axis that points upwards: "x", "y", "z\""""
    unit: str | None = None
    """of length"""
    order: tuple[str, ...] = ()
    """names of the markers in the robot file's order"""
    body: str | None = None
    """which rigid body is the platform"""
    rate: float | None = None
    """Hz"""
    cables: tuple[int, ...] = ()
    """1-based: which of a log's cables are the robot file's 1, 2, …"""


@dataclass(frozen=True, eq=False)
class Takes:
    """Takes of one robot that become one campaign."""

    kind: str
    name: str
    robot: Robot
    """with the markers of the platform, body frame"""
    geometry_source: Path
    takes: tuple[Take, ...]
    unread: Mapping[str, str] = field(default_factory=dict[str, str])
    """takes and logs that could not be read: id → why"""
    asked: Asked = field(default_factory=Asked)
