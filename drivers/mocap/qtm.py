"""Qualisys Track Manager's real-time protocol (TCP 22223, little endian): labelled 3D markers by name.

    packet      i32 size with this head, i32 type (0 error, 1 command, 2 XML, 3 data, 4 no more data), body
    data        i64 time in µs, i32 frame, i32 components; each u32 size with its head, u32 type
    component 1 u32 markers, u16 drop rate, u16 out-of-sync rate, then for each 3 f32 in mm; NaN where not seen

The server greets; `QtmRequests` then sets the version and asks for names (XML) and for all frames. Names and frames
come in one stream, so that a raw log has both.
"""

import re
import struct

from drivers.mocap.decoder import DecodedFrame, Event, Malformed, Position, plausible

DEFAULT_PORT = 22223
ERROR, COMMAND, XML, DATA = 0, 1, 2, 3
LABELLED = 1
LONGEST = 1 << 24
"""bytes of a packet"""
VERSION = "1.19"
_HEAD = struct.Struct("<II")
_DATA = struct.Struct("<qii")
_COMPONENT = struct.Struct("<IHH")
_POINT = struct.Struct("<3f")
_METRE = 1e-3
_SHOWN = 12
_LABELS = re.compile(rb"<Label>\s*<Name>([^<]*)</Name>")


def command(text: str) -> bytes:
    """The packet of a command."""
    body = text.encode("ascii") + b"\0"
    return _HEAD.pack(_HEAD.size + len(body), COMMAND) + body


REQUESTS = command(f"Version {VERSION}") + command("GetParameters 3D") + command("StreamFrames AllFrames 3D")


class QtmRequests:
    """The client's side of one connection: asks once the server has greeted."""

    def __init__(self) -> None:
        self._asked = False

    def receive(self, data: bytes) -> bytes:
        """What to send after these bytes."""
        if self._asked or not data:
            return b""
        self._asked = True
        return REQUESTS


class QtmDecoder:
    """Decoder of markers by their names in QTM, main marker first."""

    modulus = 1 << 31

    def __init__(self, names: tuple[str, ...]) -> None:
        self.names = names
        self._rest = bytearray()
        self._labels: tuple[str, ...] = ()

    def receive(self, data: bytes) -> list[Event]:
        """A frame for each data packet."""
        self._rest += data
        events: list[Event] = []
        while len(self._rest) >= _HEAD.size:
            size, kind = _HEAD.unpack_from(self._rest)
            if not _HEAD.size <= size <= LONGEST or kind > 255:
                # The protocol has nothing to find a packet's beginning by: what is here cannot be put right.
                self._rest.clear()
                events.append(Malformed(f"QTM: a packet of {size} bytes, type {kind}; is this its port (22223)?"))
            elif len(self._rest) < size:
                break
            else:
                event = self._packet(kind, bytes(self._rest[_HEAD.size : size]))
                del self._rest[:size]
                events += [] if event is None else [event]
        return events

    def restart(self) -> None:
        """Forget the unfinished packet and the names: the project may be another."""
        self._rest.clear()
        self._labels = ()

    def advice(self) -> str:
        """Names the markers that are wanted beside those that are labelled in QTM."""
        missing = [name for name in self.names if name not in self._labels]
        if not missing:
            return "The markers are labelled in QTM, but not seen: look for occlusion, or an AIM model that lost them."
        carried = ", ".join(self._labels[:_SHOWN]) or "no labelled marker"
        return f"QTM has {carried}, not {', '.join(missing)}: is that the label, is an AIM model applied in real time?"

    def _packet(self, kind: int, body: bytes) -> Event | None:
        if kind == DATA:
            try:
                return self._frame(body)
            except struct.error as error:
                return Malformed(f"QTM: a data packet ends too early ({error})")
        if kind == XML:
            self._labels = tuple(name.decode("utf-8", "replace") for name in _LABELS.findall(body))
        if kind == ERROR:
            return Malformed(f"QTM answers: {body.rstrip(bytes(1)).decode('utf-8', 'replace')[:80]}")
        return None

    def _frame(self, body: bytes) -> Event | None:
        _, number, components = _DATA.unpack_from(body)
        at = _DATA.size
        for _ in range(components):
            size, kind = _HEAD.unpack_from(body, at)
            if size < _HEAD.size:
                raise struct.error(f"a component of {size} bytes")
            if kind == LABELLED:
                return self._labelled(number, body[at + _HEAD.size : at + size])
            at += size
        return None

    def _labelled(self, number: int, body: bytes) -> Event:
        count, _, _ = _COMPONENT.unpack_from(body)
        places: dict[str, Position] = {}
        for index, name in enumerate(self._labels[:count]):
            x, y, z = _POINT.unpack_from(body, _COMPONENT.size + index * _POINT.size)
            if x == x and y == y and z == z:
                places[name] = (x * _METRE, y * _METRE, z * _METRE)
        positions = tuple([places.get(name) for name in self.names])
        if not all(plausible(place) for place in positions if place is not None):
            return Malformed(f"frame {number}: a marker is more than a kilometre away")
        return DecodedFrame(number % self.modulus, positions)
