"""Vicon DataStream: labelled and unlabelled markers, occlusion, the system's own latency (Nexus, Tracker, Blade).

The server speaks first and tells what it can send; the client wishes for a part of it and then gets every frame
(`DataStreamWishes`). A marker that no camera sees is absent from its frame. `vicon_packets` has the framing.
"""

import struct

from drivers.mocap.decoders.decoder import UNLABELLED, Event, Malformed, Position, frame_of
from drivers.mocap.decoders.vicon_packets import (
    Fields,
    PacketBlock,
    PacketSplitter,
    StreamPacket,
    enums,
    packet,
)

WISHES = (
    PacketBlock.STREAM_INFO,
    PacketBlock.SUBJECT_INFO,
    PacketBlock.FRAME_INFO,
    PacketBlock.LABELLED,
    PacketBlock.UNLABELLED,
    PacketBlock.LATENCY,
    PacketBlock.CONTENTS,
)
_METRE = 1e-3
_U32 = struct.Struct("<I")
_U32_PAIR = struct.Struct("<II")
_SEGMENT = struct.Struct("<II6f")
_RECON = struct.Struct("<II13dI")
"""subject, marker, radius, position (3), covariance (9), trajectory"""
_STRAY = struct.Struct("<13dI")
"""radius, position (3), covariance (9), trajectory"""
NO_LABEL = (-1, -1)
"""stands for subject and marker of one that belongs to no subject"""
Sighting = tuple[tuple[int, int], Position]
_SHOWN = 12
"""names in a piece of advice"""


class DataStreamWishes:
    """The client's side of one connection: bytes of the server in, what to answer out."""

    def __init__(self) -> None:
        self._splitter: PacketSplitter | None = PacketSplitter()

    def receive(self, data: bytes) -> bytes:
        """The bytes to send now; empty once all requests have been sent."""
        if self._splitter is None:
            return b""
        for item in self._splitter.receive(data):
            if isinstance(item, StreamPacket):
                for kind, body in item.blocks:
                    if kind == PacketBlock.OBJECT_ENUMS:
                        self._splitter = None
                        return wish(enums(body))
        return b""


def wish(offered: frozenset[int]) -> bytes:
    """The answer to a server that offers these blocks: what we want of them, and every frame from now on."""
    wanted = [kind for kind in WISHES if kind in offered]
    listed = struct.pack(f"<{len(wanted) + 1}I", len(wanted), *wanted)
    return packet((PacketBlock.OBJECT_ENUMS, listed)) + packet((PacketBlock.REQUEST_FRAME, b"\x01"))


class ViconDataStreamDecoder:
    """Decoder of named markers: "marker" where one subject has it, else "subject/marker", or the only "unlabelled" one.

    Main marker first.
    """

    modulus = 1 << 32

    def __init__(self, names: tuple[str, ...]) -> None:
        self.names = names
        """as in the rig file"""
        self.latency: float | None = None
        """s that the system took from exposure to sending, by its own account; None until it says so"""
        self.unlabelled = 0
        """markers of the newest frame that belong to no subject"""
        self._splitter = PacketSplitter()
        self._offered: frozenset[int] | None = None
        self._wanted: tuple[tuple[int, int] | None, ...] = (None,) * len(names)
        self._carried: tuple[str, ...] = ()
        self._labelled: list[Sighting] = []

    def receive(self, data: bytes) -> list[Event]:
        """A frame for each packet that has a frame number."""
        events: list[Event] = []
        for item in self._splitter.receive(data):
            event = item if isinstance(item, Malformed) else self._packet(item)
            if event is not None:
                events.append(event)
        return events

    def restart(self) -> None:
        """Forget the unfinished packet, and which number a marker had: the server may be another."""
        self._splitter = PacketSplitter()
        self._wanted, self._carried, self._labelled = (None,) * len(self.names), (), []

    def advice(self) -> str:
        """Names the markers that are wanted beside those that the stream carries."""
        if self._offered is not None and PacketBlock.LABELLED not in self._offered:
            return "The server offers no labelled markers: is a subject loaded, is this the DataStream's port (801)?"
        missing = [name for name, key in zip(self.names, self._wanted, strict=True) if key is None]
        if not missing:
            seen = f", {self.unlabelled} unlabelled markers are" if self.unlabelled else ""
            return f"The markers are known there, but not seen{seen}: look for occlusion, or labels that were lost."
        carried = ", ".join(self._carried[:_SHOWN]) or "no marker of any subject"
        return (
            f"The stream carries {carried}, not {', '.join(missing)}: is that its name there, is the subject enabled? "
            'Where two subjects have a marker of one name, write "subject/marker".'
        )

    def _packet(self, item: StreamPacket) -> Event | None:
        try:
            return self._read(item)
        except struct.error as error:
            return Malformed(f"Vicon DataStream: a block ends too early ({error})")

    def _read(self, item: StreamPacket) -> Event | None:
        number: int | None = None
        labelled: list[Sighting] | None = None
        strays: list[Sighting] = []
        subjects: list[tuple[int, str, dict[int, str]]] = []
        unchanged: frozenset[int] = frozenset()
        for kind, body in item.blocks:
            match kind:
                case PacketBlock.FRAME_INFO:
                    number = int(Fields(body).take(_U32)[0])
                case PacketBlock.LABELLED:
                    labelled = _labelled(body)
                case PacketBlock.SUBJECT_INFO:
                    subjects.append(_subject(body))
                case PacketBlock.UNLABELLED:
                    strays = _strays(body)
                    self.unlabelled = len(strays)
                case PacketBlock.CONTENTS:
                    unchanged = _unchanged(body)
                case _:
                    self._note(kind, body)
        if subjects:
            self._know(subjects)
        if labelled is None:
            # A block that the server lists as unchanged is the one before; one that is neither here nor there is empty.
            labelled = self._labelled if PacketBlock.LABELLED in unchanged else []
        if number is None:
            return None
        self._labelled = labelled
        return frame_of(number, self.names, self._wanted, labelled + strays, alone=NO_LABEL)

    def _note(self, kind: int, body: bytes) -> None:
        """What the stream tells besides frames."""
        match kind:
            case PacketBlock.LATENCY:
                self.latency = _latency(body)
            case PacketBlock.OBJECT_ENUMS:
                self._offered = enums(body)
            case _:
                pass  # what nobody here needs

    def _know(self, subjects: list[tuple[int, str, dict[int, str]]]) -> None:
        by_name: dict[str, tuple[int, int] | None] = {UNLABELLED: NO_LABEL}
        for subject, name, markers in subjects:
            for marker, label in markers.items():
                by_name[f"{name}/{label}"] = (subject, marker)
                by_name[label] = None if label in by_name else (subject, marker)  # a name that two have tells nothing
        self._wanted = tuple([by_name.get(name) for name in self.names])
        self._carried = tuple(f"{name}/{label}" for _, name, markers in subjects for label in markers.values())


def _labelled(body: bytes) -> list[Sighting]:
    """Positions in m by subject and marker."""
    fields = Fields(body)
    found: list[Sighting] = []
    for _ in range(fields.count(_RECON.size)):
        subject, marker, _, x, y, z, *_ = fields.take(_RECON)
        found.append(((int(subject), int(marker)), (x * _METRE, y * _METRE, z * _METRE)))
    return found


def _strays(body: bytes) -> list[Sighting]:
    """Positions in m of markers that belong to no subject."""
    fields = Fields(body)
    found: list[Sighting] = []
    for _ in range(fields.count(_STRAY.size)):
        _, x, y, z, *_ = fields.take(_STRAY)
        found.append((NO_LABEL, (x * _METRE, y * _METRE, z * _METRE)))
    return found


def _subject(body: bytes) -> tuple[int, str, dict[int, str]]:
    """Number, name and markers of a subject."""
    fields = Fields(body)
    number = int(fields.take(_U32)[0])
    name = fields.text()
    for _ in range(fields.count(_SEGMENT.size)):
        fields.take(_SEGMENT)
        fields.text()
    markers: dict[int, str] = {}
    for _ in range(fields.count(8)):
        marker = int(fields.take(_U32)[0])
        markers[marker] = fields.text()
    return number, name, markers


def _latency(body: bytes) -> float:
    """s: each stage since the one before, summed."""
    fields = Fields(body)
    total = 0.0
    for _ in range(fields.count(12)):
        fields.text()
        total += fields.take(_F64)[0]
    return total


def _unchanged(body: bytes) -> frozenset[int]:
    """Kinds of blocks that are as in the packet before."""
    fields = Fields(body)
    for _ in range(fields.count(8)):
        fields.take(_U32_PAIR)
    return frozenset(int(fields.take(_U32)[0]) for _ in range(fields.count(4)))


_F64 = struct.Struct("<d")
