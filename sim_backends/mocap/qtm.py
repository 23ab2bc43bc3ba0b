"""Qualisys's real-time server as it speaks over TCP, written from the wire format alone."""

import math
import struct
from collections.abc import Callable, Sequence
from xml.sax.saxutils import escape

from sim_backends.mocap.encoders import Positions

_ERROR, _COMMAND, _XML, _DATA, _EVENT = 0, 1, 2, 3, 6
_LABELLED = 1
_NAN = (math.nan, math.nan, math.nan)


class QtmEncoder:
    """A data packet for each frame with one component, the labelled markers; NaN where occluded."""

    is_stream = True

    def __init__(self, rate: float = 100.0) -> None:
        """rate in Hz, for the time stamps."""
        self._period = 1e6 / rate

    def encode(self, number: int, positions: Positions) -> bytes:
        """One packet; positions in m."""
        points = b"".join(struct.pack("<3f", *(1e3 * v for v in (_NAN if p is None else p))) for p in positions)
        component = struct.pack("<IIIHH", 16 + len(points), _LABELLED, len(positions), 0, 0) + points
        return _packet(_DATA, struct.pack("<qii", round(number * self._period), number, 1) + component)


class QtmSession:
    """One client: greeted, asked for its version, told the labels, streamed to from StreamFrames on.

    Not simulated: components other than labelled 3D, UDP streams, control of QTM, byte order big endian.
    """

    def __init__(self, labels: Sequence[str]) -> None:
        """Marker names."""
        self._parameters = _parameters(labels)
        self._streaming = False
        self._rest = b""

    def relabelled(self, labels: Sequence[str], event: int | None = None) -> bytes:
        """The operator gives the markers other labels: what is told unasked, the event's number or nothing."""
        self._parameters = _parameters(labels)
        return b"" if event is None else _packet(_EVENT, bytes((event,)))

    @staticmethod
    def maker(labels: Sequence[str]) -> Callable[[], "QtmSession"]:
        """A session for each client."""
        return lambda: QtmSession(labels)

    def greeting(self) -> bytes:
        """The server's first words."""
        return _text(_COMMAND, "QTM RT Interface connected")

    def receive(self, data: bytes) -> bytes:
        """The answers to whole commands."""
        self._rest += data
        answers = b""
        while len(self._rest) >= 8:
            size, kind = struct.unpack_from("<II", self._rest)
            if len(self._rest) < size or size < 8:
                break
            if kind == _COMMAND:
                answers += self._answer(self._rest[8:size].rstrip(b"\0").decode("ascii", "replace"))
            self._rest = self._rest[size:]
        return answers

    def pass_on(self, packet: bytes) -> bytes:
        """Frames, once they were asked for."""
        return packet if self._streaming else b""

    def _answer(self, asked: str) -> bytes:
        match asked.lower().split():
            case ["version", version]:
                return _text(_COMMAND, f"Version set to {version}")
            case ["getparameters", *_]:
                return _text(_XML, self._parameters)
            case ["streamframes", "stop"]:
                self._streaming = False
                return b""
            case ["streamframes", *_]:
                self._streaming = True
                return b""
            case _:
                return _text(_ERROR, "Parse error")


def _parameters(labels: Sequence[str]) -> str:
    named = "".join(f"<Label><Name>{escape(name)}</Name><RGBColor>255</RGBColor></Label>" for name in labels)
    return (
        f"<QTM_Parameters_Ver_1.19><The_3D><AxisUpwards>+Z</AxisUpwards><Labels>{len(labels)}</Labels>{named}"
        f"</The_3D></QTM_Parameters_Ver_1.19>"
    )


def _text(kind: int, text: str) -> bytes:
    return _packet(kind, text.encode() + b"\0")


def _packet(kind: int, body: bytes) -> bytes:
    return struct.pack("<II", 8 + len(body), kind) + body
