"""The tables of a rig file ("fidim-rig/1"), as pydantic checks them; `rig_file` reads them.

What each key means, and its unit: docs/file-keys.md, from `fidim_lab/app/formats/key_words.toml`.
"""

import re
from enum import StrEnum
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, model_validator

from fidim_lab.data.files.toml_file import Name, Table
from fidim_lab.data.rigs.rig_guard_tables import GuardsTable, PlaceTable
from fidim_lab.data.rigs.rig_serial_tables import InclinometerTable, LoadCellsTable, ReleaseTable, SeveralLoadCells
from fidim_lab.data.rigs.rig_winch_tables import RigWinchTable

Port = Annotated[int, Field(ge=1, le=65535)]


class MocapKind(StrEnum):
    """Ways in which marker positions arrive."""

    VICON_UDP = "vicon-udp"
    MARKER_TEXT = "marker-text"
    VICON_DATASTREAM = "vicon-datastream"
    LSL = "lsl"
    QTM = "qtm"
    NATNET = "natnet"
    OSC = "osc"


STANDARD_PORTS = {
    MocapKind.VICON_UDP: 51001,
    MocapKind.VICON_DATASTREAM: 801,
    MocapKind.MARKER_TEXT: 51100,
    MocapKind.OSC: 51200,
    MocapKind.QTM: 22223,
    MocapKind.NATNET: 1510,
    MocapKind.LSL: 0,
}
"""LSL finds its own"""
TRANSPORTS = {
    MocapKind.VICON_UDP: ("udp",),
    MocapKind.VICON_DATASTREAM: ("tcp",),
    MocapKind.MARKER_TEXT: ("udp", "tcp"),
    MocapKind.OSC: ("udp",),
    MocapKind.QTM: ("tcp",),
    MocapKind.NATNET: ("udp",),
    MocapKind.LSL: ("lsl",),
}
"""how each kind arrives, the usual way first"""
UNITS = {"m": 1.0, "mm": 1e-3}
NATNET_MARKER = re.compile(r"\d{1,5}/\d{1,5}|unlabelled", re.ASCII)
"""streaming ID of an asset, and the number of its marker; or the one that has no label"""


class BusTable(Table):
    """`[bus]`."""

    interface: Name
    channel: Annotated[str, BeforeValidator(str)]
    bitrate: Annotated[int, Field(ge=10_000, le=1_000_000)] = 1_000_000
    sync_rate: Annotated[float, Field(ge=1, le=500)] = 250.0
    heartbeat: Annotated[float, Field(gt=0, le=10)] = 0.05
    host_id: Annotated[int, Field(ge=1, le=127)] = 127
    options: dict[str, str | int | float | bool] = Field(default_factory=dict[str, str | int | float | bool])

    @property
    def name(self) -> str:
        """For messages."""
        return f"{self.interface} {self.channel}"


class MocapTable(Table):
    """`[motion_capture]`."""

    kind: MocapKind
    host: Name = "0.0.0.0"
    port: Port | None = None
    transport: Literal["udp", "tcp", "lsl"] | None = None
    rate: Annotated[float, Field(ge=1, le=2000)]
    markers: tuple[Name, ...] = ()
    subject: Name | None = None
    up: Literal["z", "y"] = "z"
    unit: Literal["m", "mm"] = "m"
    stream: Name | None = None
    frame_address: Annotated[str, Field(pattern="^/.")] = "/frame"
    sender: Name | None = None

    @property
    def way(self) -> str:
        """The transport, as given or usual."""
        return self.transport or TRANSPORTS[self.kind][0]

    @model_validator(mode="after")
    def _possible(self) -> "MocapTable":
        if self.way not in TRANSPORTS[self.kind]:
            ways = " or ".join(f'"{way}"' for way in TRANSPORTS[self.kind])
            raise ValueError(f'transport: "{self.way}", {self.kind} is always {ways}')
        if self.kind is MocapKind.VICON_UDP and bool(self.markers) == (self.subject is not None):
            raise ValueError("markers, subject: give one of them: objects that are markers, or the tracked body")
        if self.subject is not None and self.kind not in (MocapKind.VICON_UDP, MocapKind.VICON_DATASTREAM):
            raise ValueError(f"subject: {self.kind} carries markers only; leave it out")
        if self.sender is not None and (self.way == "tcp" or self.kind is MocapKind.NATNET):
            raise ValueError(f"sender: {self.kind} by {self.way} comes from host alone; leave it out")
        if self.host == "0.0.0.0" and (self.way == "tcp" or self.kind is MocapKind.NATNET):
            raise ValueError("host: is missing; it is the server's address")
        if self.kind is MocapKind.NATNET and not (self.markers and all(map(NATNET_MARKER.fullmatch, self.markers))):
            raise ValueError('markers: natnet needs "ASSET/NUMBER" of each, as ["1/1"] (Motive: streaming ID, label)')
        if (self.kind is MocapKind.LSL) != (self.stream is not None):
            raise ValueError("stream: is the name of an LSL stream, and lsl needs one")
        if self.unit != "m" and self.kind not in (MocapKind.OSC, MocapKind.LSL):
            raise ValueError(f"unit: {self.kind} has its own; leave it out")
        return self


class HandTable(Table):
    """`[simulated_hand]`."""

    host: Name = "127.0.0.1"
    port: Port


class RigTable(Table):
    """The whole file."""

    format: Literal["fidim-rig/1"]
    name: Name
    robot: Name
    bus: BusTable
    winch: Annotated[list[RigWinchTable], Field(min_length=1, max_length=5)]
    motion_capture: MocapTable
    guards: GuardsTable = GuardsTable()
    place: PlaceTable = PlaceTable()
    simulated_hand: HandTable | None = None
    every_winch: dict[str, object] = Field(default_factory=dict[str, object])
    release: ReleaseTable | None = None
    load_cells: SeveralLoadCells = Field(default_factory=list[LoadCellsTable])
    inclinometer: InclinometerTable | None = None

    @model_validator(mode="before")
    @classmethod
    def _fill_in(cls, table: dict[str, object]) -> dict[str, object]:
        """What `[every_winch]` says counts for each winch that does not say otherwise."""
        common, winches = table.get("every_winch", {}), table.get("winch")
        if not isinstance(common, dict) or not isinstance(winches, list):
            return table  # said below as what it is
        return table | {"winch": [common | winch if isinstance(winch, dict) else winch for winch in winches]}

    @model_validator(mode="after")
    def _consistent(self) -> "RigTable":
        problems: list[str] = []
        for key in ("name", "node_id"):
            taken: set[object] = set()
            for number, winch in enumerate(self.winch, start=1):
                value = getattr(winch, key)
                if value in taken:
                    problems.append(f"winch {number}, {key}: {value!r} is taken by another winch")
                taken.add(value)
        if any(winch.node_id == self.bus.host_id for winch in self.winch):
            problems.append(f"bus, host_id: {self.bus.host_id} is a winch's node_id")
        if problems:
            raise ValueError("; ".join(problems))
        return self
