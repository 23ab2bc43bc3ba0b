"""The hardware of a laboratory as its rig file and the files beside it state it: frozen values in SI units.

`rig_file` reads them. Tables that need nothing but themselves are used as they were checked (`rig_tables`). What a
driver makes of all this is `fidim_lab.app.compose`'s matter; nothing here opens anything.
"""

from dataclasses import dataclass
from pathlib import Path

from fidim_lab.data.records import Robot
from fidim_lab.data.rigs.home_file import WinchHome
from fidim_lab.data.rigs.rig_guard_tables import GuardsTable, PlaceTable
from fidim_lab.data.rigs.rig_serial import GaugeEntry, ReleaseEntry
from fidim_lab.data.rigs.rig_tables import BusTable, HandTable, MocapKind
from fidim_lab.data.rigs.rig_winch_tables import GENERIC, RigWinchTable


class WinchEntry(RigWinchTable):
    """One CANopen winch: its table, and what other files say of it."""

    torque_constant: float
    """N m/A, by the robot file"""
    home: WinchHome | None = None
    """where `home` was run; home_count and home_length are then its"""

    @property
    def eds_file(self) -> Path | None:
        """The drive's object dictionary; None: the built-in generic CiA 402 one."""
        return None if self.eds == GENERIC else Path(self.eds)

    @property
    def multi_turn(self) -> bool:
        """Whether the encoder keeps its zero without power."""
        return self.encoder == "multi-turn"


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


@dataclass(frozen=True, eq=False)
class RigFile:
    """Everything a rig file says."""

    path: Path
    name: str
    robot_path: Path
    robot: Robot
    """as its file says, with the winches' measured tension gain where the rig file has one"""
    bus: BusTable
    winches: tuple[WinchEntry, ...]
    motion_capture: MocapEntry
    guards: GuardsTable
    place: PlaceTable
    hand: HandTable | None = None
    release: ReleaseEntry | None = None
    gauges: tuple[GaugeEntry, ...] = ()
    keeps_homes: bool = True
    """what is learnt of encoders' zeros goes into RIG.home.toml; not so in a rehearsal"""
