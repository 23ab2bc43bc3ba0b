"""Qualisys Track Manager's real-time protocol (TCP 22223, little endian): labelled 3D markers by name.

    packet      i32 size with this head, i32 type (0 error, 1 command, 2 XML, 3 data, 4 no more data, 6 event), body
    data        i64 time in µs, i32 frame, i32 components; each u32 size with its head, u32 type
    component 1 u32 markers, u16 drop rate, u16 out-of-sync rate, then for each 3 f32 in mm; NaN where not seen
    component 2 the same of markers without a label, each with an u32 id at its end

The server greets; `QtmRequests` then sets the version and asks for names (XML) and for all frames. Names and frames
come in one stream, so that a raw log has both. A frame has positions in the order of the labels and no names, and the
operator may change labels at any time; QTM tells it by an event at most. So names are asked for again after each event,
where a frame has another number of markers, and once a second; after an event, and in a frame of another number, no
marker has a position until the names are known again.
"""

import re
import struct
from html import unescape

from drivers.mocap.decoders.decoder import UNLABELLED, Event, Malformed, Position, frame_of

ERROR, COMMAND, XML, DATA, EVENT = 0, 1, 2, 3, 6
LABELLED, WITHOUT_LABEL = 1, 2
LONGEST = 1 << 24
"""bytes of a packet"""
VERSION = "1.19"
AGAIN = 1_000_000
"""µs of QTM's time after which names are asked for again: as long as an unseen change of labels can last"""
_HEAD = struct.Struct("<II")
_DATA = struct.Struct("<qii")
_COMPONENT = struct.Struct("<IHH")
_POINT = struct.Struct("<3f")
_STRAY = struct.Struct("<3fI")
_METRE = 1e-3
_SHOWN = 12
_LABELS = re.compile(rb"<Label>(?:(?!</Label>).)*?<Name>([^<]*)</Name>", re.DOTALL)


def command(text: str) -> bytes:
    """The packet of a command."""
    body = text.encode("ascii") + b"\0"
    return _HEAD.pack(_HEAD.size + len(body), COMMAND) + body


NAMES = command("GetParameters 3D")
REQUESTS = command(f"Version {VERSION}") + NAMES + command("StreamFrames AllFrames 3D 3DNoLabels")


class QtmPackets:
    """Puts packets together from pieces."""

    def __init__(self) -> None:
        self._rest = bytearray()

    def receive(self, data: bytes) -> list[tuple[int, bytes] | Malformed]:
        """Type and body of the packets that `data` completes. Never raises."""
        self._rest += data
        found: list[tuple[int, bytes] | Malformed] = []
        while len(self._rest) >= _HEAD.size:
            size, kind = _HEAD.unpack_from(self._rest)
            if not _HEAD.size <= size <= LONGEST or kind > 255:
                # The protocol has nothing to find a packet's beginning by: what is here cannot be put right.
                self._rest.clear()
                found.append(Malformed(f"QTM: a packet of {size} bytes, type {kind}; is this its port (22223)?"))
            elif len(self._rest) < size:
                break
            else:
                found.append((kind, bytes(self._rest[_HEAD.size : size])))
                del self._rest[:size]
        return found


class QtmRequests:
    """The client's side of one connection: asks once it is greeted, and again for names that may have changed."""

    def __init__(self) -> None:
        self._packets = QtmPackets()
        self._greeted = False
        self._asked_at: int | None = None
        """µs by QTM's clock; None: asked, and no frame has come since"""
        self._count: int | None = None

    def receive(self, data: bytes) -> bytes:
        """The bytes to send after these bytes."""
        if not data:
            return b""
        packets = self._packets.receive(data)
        if not self._greeted:
            self._greeted = True
            return REQUESTS
        ask = [self._calls_for_names(*packet) for packet in packets if not isinstance(packet, Malformed)]
        if any(ask):
            self._asked_at = None
            return NAMES
        return b""

    def _calls_for_names(self, kind: int, body: bytes) -> bool:
        if kind != DATA:
            return kind == EVENT
        try:
            time, _, _ = _DATA.unpack_from(body)
            labelled, _ = _parts(body)
        except struct.error:
            return False
        before, self._count = self._count, len(labelled)
        if self._asked_at is None or time < self._asked_at:
            self._asked_at = time
        return before not in (None, len(labelled)) or time - self._asked_at >= AGAIN


class QtmDecoder:
    """Decoder of markers by their names in QTM, or of the only "unlabelled" one; main marker first."""

    modulus = 1 << 31

    def __init__(self, names: tuple[str, ...]) -> None:
        self.names = names
        self._packets = QtmPackets()
        self._labels: tuple[str, ...] = ()
        self._known = False
        """whether the labels are those of now"""
        self._unlabelled = 0

    def receive(self, data: bytes) -> list[Event]:
        """A frame for each data packet."""
        events = [item if isinstance(item, Malformed) else self._packet(*item) for item in self._packets.receive(data)]
        return [event for event in events if event is not None]

    def restart(self) -> None:
        """Forget the unfinished packet and the names: the project may be another."""
        self._packets = QtmPackets()
        self._labels, self._known = (), False

    def advice(self) -> str:
        """Names the markers that are wanted beside those that are labelled in QTM."""
        missing = [name for name in self.names if name not in (*self._labels, UNLABELLED)]
        seen = f" Markers without a label: {self._unlabelled}." if self._unlabelled else ""
        if not missing:
            return f"The markers are labelled in QTM, but not seen: occlusion, or an AIM model that lost them?{seen}"
        carried = ", ".join(self._labels[:_SHOWN]) or "no labelled marker"
        return f"QTM has {carried}, not {', '.join(missing)}: is that the label, is an AIM model applied?{seen}"

    def _packet(self, kind: int, body: bytes) -> Event | None:
        if kind == DATA:
            try:
                return self._frame(body)
            except struct.error as error:
                return Malformed(f"QTM: a data packet ends too early ({error})")
        if kind == XML:
            found = _LABELS.findall(body)
            self._labels, self._known = tuple([unescape(name.decode("utf-8", "replace")) for name in found]), True
        if kind == EVENT:
            self._known = False
        if kind == ERROR:
            return Malformed(f"QTM answers: {body.rstrip(bytes(1)).decode('utf-8', 'replace')[:80]}")
        return None

    def _frame(self, body: bytes) -> Event | None:
        _, number, _ = _DATA.unpack_from(body)
        labelled, strays = _parts(body)
        self._unlabelled = len(strays)
        if len(labelled) != len(self._labels):
            self._known = False  # somebody has changed them; the names are on their way
        seen = [(UNLABELLED, place) for place in strays]
        if self._known:
            seen += zip(self._labels, labelled, strict=True)
        return frame_of(number % self.modulus, self.names, self.names, seen, alone=UNLABELLED)


def _parts(body: bytes) -> tuple[list[Position], list[Position]]:
    """Places of the labelled markers in their order, and of those without a label, m. Raises struct.error."""
    _, _, components = _DATA.unpack_from(body)
    at = _DATA.size
    labelled: list[Position] = []
    strays: list[Position] = []
    for _ in range(components):
        size, kind = _HEAD.unpack_from(body, at)
        if size < _HEAD.size:
            raise struct.error(f"a component of {size} bytes")
        part = body[at + _HEAD.size : at + size]
        if kind == LABELLED:
            labelled = _places(part, _POINT)
        elif kind == WITHOUT_LABEL:
            strays = _places(part, _STRAY)
        at += size
    return labelled, strays


def _places(part: bytes, layout: struct.Struct) -> list[Position]:
    count, _, _ = _COMPONENT.unpack_from(part)
    if count * layout.size > len(part) - _COMPONENT.size:
        raise struct.error(f"{count} markers announced, {len(part)} bytes there")
    places: list[Position] = []
    for index in range(count):
        x, y, z, *_ = layout.unpack_from(part, _COMPONENT.size + index * layout.size)
        places.append((x * _METRE, y * _METRE, z * _METRE))
    return places
