"""The hardware of a laboratory as its rig file states it: frozen values in SI units. `rig_file` reads them.

What a driver makes of them is `fidim_lab.app.compose`'s matter; nothing here opens anything.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any

from fidim_lab.data.records import Robot
from fidim_lab.data.rigs.rig_serial import GaugeEntry, ReleaseEntry


@dataclass(frozen=True)
class BusEntry:
    """The CAN bus."""

    interface: str
    """as python-can names it"""
    channel: str
    bitrate: int
    """bit/s"""
    sync_rate: float
    """Hz"""
    heartbeat: float
    """s between the host's heartbeats"""
    host_id: int
    """node id of the host's heartbeat"""
    options: Mapping[str, Any] = field(default_factory=dict[str, Any])
    """what else python-can's interface takes"""

    @property
    def name(self) -> str:
        """For messages."""
        return f"{self.interface} {self.channel}"


@dataclass(frozen=True)
class StopEntry:
    """What a drive does without us: values of its CiA 402 option codes."""

    quick_stop: int = 6
    halt: int = 1
    fault: int = 2
    connection_lost: int = 3
    communication_error: int = 1


@dataclass(frozen=True)
class TensionEntry:
    """Cable tension from the motor current I: gain · I + offset, within ± friction.

    With a scatter, friction is the part that changes sign with the direction D of the last move (+1 paid out):
    (gain · I + offset + D · friction) / (1 − D · load_friction), within ± scatter.
    """

    gain: float | None = None
    """N/A; None takes the robot file's drum, gear, efficiency and torque constant"""
    offset: float = 0.0
    """N"""
    friction: float | None = None
    """N, half the band between winding and paying out; None: not measured"""
    load_friction: float = 0.0
    """the part of it that grows with the load: a gear's efficiency differs by direction"""
    scatter: float | None = None
    """N, half the band that is left when the direction of the last move is known"""


@dataclass(frozen=True)
class TemperatureEntry:
    """The vendor object in which a drive family keeps its temperature."""

    index: int
    sub: int = 0
    scale: float = 1.0
    """°C for one digit"""


@dataclass(frozen=True)
class SignalEntry:
    """A digital input or output of a drive."""

    bit: int
    active: int = 1
    """its level while it means what its name says"""


@dataclass(frozen=True)
class WinchHome:
    """The zero of a winch's encoder, as `home` has found it (`home_file`)."""

    node_id: int
    vendor_id: int
    product_code: int
    serial_number: int
    home_count: int
    home_length: float
    """m"""
    at: str
    """ISO 8601"""
    last_count: int | None = None
    """where the encoder was seen last"""


@dataclass(frozen=True)
class WinchEntry:
    """One CANopen winch."""

    name: str
    node_id: int
    eds: Path | None
    """None: the built-in generic CiA 402 dictionary"""
    direction: int
    """+1 where rising counts pay cable out"""
    reversed: bool
    """whether the drive's polarity (607E) is set; `direction` is as seen with that"""
    counts_per_turn: float
    """encoder counts for one turn of the motor"""
    gear_ratio: float
    """motor turns for one turn of the drum"""
    drum_radius: float
    """m, to the middle of the cable"""
    rated_current: float
    """A"""
    torque_constant: float
    """N m/A, by the robot file"""
    rated_torque: float | None
    """N m, None: not compared"""
    current_limit: float
    """A"""
    length_limits: tuple[float, float]
    """m"""
    max_speed: float
    """m/s of cable"""
    max_acceleration: float
    """m/s²"""
    quick_stop_deceleration: float
    """m/s²"""
    following_error: float
    """m"""
    following_error_time: float
    """s"""
    home_count: int
    home_length: float
    """m of cable at `home_count`"""
    heartbeat: float
    """s between the drive's heartbeats"""
    host_timeout: float
    """s without the host's heartbeat until the drive stops by itself"""
    sdo_timeout: float
    """s that the drive may take to answer a request"""
    brake_time: float
    """s that the brake takes; 0 without one"""
    vendor_id: int | None
    product_code: int | None
    serial_number: int | None
    family: str
    """a built-in drive family, or a file of one"""
    load: str | None
    """what the drive tells of its load: "current" (6078) or "torque" (6077); None: as its family does"""
    mode: str
    """CiA 402 mode of moves: "profile-position" or "cyclic-position\""""
    multi_turn: bool
    """the encoder keeps its zero without power"""
    turned: float
    """m of cable by which another encoder may have moved since it was seen last"""
    home: WinchHome | None
    """where `home` was run; home_count and home_length are then its"""
    temperature: TemperatureEntry | None
    """None: the drive is not asked"""
    sto: SignalEntry | None
    """input of 60FD that is active while safe torque off is"""
    brake_output: SignalEntry | None
    """output of 60FE that is active while the brake is applied"""
    tension: TensionEntry
    stop: StopEntry


class MocapKind(StrEnum):
    """Ways in which marker positions arrive."""

    VICON_UDP = "vicon-udp"
    MARKER_TEXT = "marker-text"
    VICON_DATASTREAM = "vicon-datastream"
    LSL = "lsl"
    QTM = "qtm"
    NATNET = "natnet"
    OSC = "osc"


@dataclass(frozen=True)
class MocapEntry:
    """The motion-capture system."""

    kind: MocapKind
    host: str
    """the server's address; for datagrams the local address that is listened at"""
    port: int
    transport: str
    """"udp", "tcp", or "lsl", which finds its streams by itself"""
    rate: float
    """frames a second, Hz"""
    markers: tuple[str, ...]
    """names of the markers, main marker first, in the order of the robot file"""
    subject: str | None
    """a tracked rigid body that carries the robot file's markers, instead of named markers"""
    up: str
    """axis of the motion-capture frame that points up: "z" or "y\""""
    unit: float = 1.0
    """m for one unit on the wire, where the format leaves it open (osc, lsl)"""
    stream: str | None = None
    """the name of an LSL stream"""
    sender: str | None = None
    """the only address whose datagrams count, or computer or source of an LSL stream; None: the first that is heard"""
    frame_address: str = "/frame"
    """of the OSC message that carries the frame number"""

    @property
    def place(self) -> str:
        """Where it is, for messages."""
        return f"stream {self.stream!r}" if self.transport == "lsl" else f"{self.host}:{self.port}"


@dataclass(frozen=True)
class HandEntry:
    """Where the simulated hand listens that answers prompts; a real laboratory has a person instead."""

    host: str
    port: int


class GuardReaction(StrEnum):
    """What a guard that trips does."""

    HOLD = "hold"
    QUICK_STOP = "quick-stop"
    REJECT_WINDOW = "reject-window"
    """nothing at once; the window is judged bad when it is checked, and recorded again"""
    WARN = "warn"
    """the run goes on, and everybody is told once"""


@dataclass(frozen=True)
class GuardEntry:
    """One line of the reaction table; a threshold that is absent has the project's default."""

    reaction: GuardReaction
    thresholds: Mapping[str, float]


@dataclass(frozen=True)
class PlaceEntry:
    """How far the main marker may be from where cable lengths and statics put it."""

    off: float
    """m"""
    change: float
    """m, from one place to the next"""
    part: float
    """of the longest cable's way between them, in addition"""


@dataclass(frozen=True, eq=False)
class RigFile:
    """Everything a rig file says."""

    path: Path
    name: str
    robot_path: Path
    robot: Robot
    """as its file says, with the winches' measured tension gain where the rig file has one"""
    bus: BusEntry
    winches: tuple[WinchEntry, ...]
    motion_capture: MocapEntry
    guards: Mapping[str, GuardEntry]
    place: PlaceEntry
    hand: HandEntry | None = None
    release: ReleaseEntry | None = None
    gauges: tuple[GaugeEntry, ...] = ()
    keeps_homes: bool = True
    """what is learnt of encoders' zeros goes into RIG.home.toml; not so in a rehearsal"""
