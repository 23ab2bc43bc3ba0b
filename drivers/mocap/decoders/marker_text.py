r"""Plain lines of numbers, over TCP or UDP: what a lab writes in ten lines of any language. One line is one frame:

    frame,x,y,z[,x2,y2,z2 …][*hh]\n        e.g.  1042,1.2701,-0.1698,-0.3204,,,*1F

Frame counter, then metres in the motion-capture frame, main marker first. Three blank fields, `nan`
or 0,0,0 are an occluded marker. `*hh` is optional: the exclusive-or of all bytes before the `*` as two hexadecimal
digits; where the sender can, it should: without it a damaged digit is just another number. A leading `FRAME ` or
`FRAME,` is accepted.
Lines may be torn anywhere and are put together again; empty lines and lines that start with `#` are ignored.
"""

from collections.abc import Sequence
from functools import reduce
from operator import xor

from drivers.mocap.decoders.decoder import HIGHEST, DecodedFrame, Event, Malformed, Position, is_place, plausible

LONGEST_LINE = 4096
_LEGAL = b"0123456789+-.eE,nNaA \t"
_SHOWN = 60


class MarkerTextDecoder:
    """Decoder of marker lines with a fixed number of markers."""

    modulus = None
    """the sender's counter never wraps"""

    def __init__(self, markers: int, *, checksum_required: bool = False) -> None:
        self.markers = markers
        """how many a line has"""
        self._fields = 1 + 3 * markers
        self._checksum_required = checksum_required
        self._rest = b""
        self._skipping = False

    def receive(self, data: bytes) -> list[Event]:
        """The frames of all lines that `data` completes."""
        *lines, rest = (self._rest + data).split(b"\n")
        events: list[Event] = []
        for line in lines:
            if self._skipping:  # the tail of a line that was already reported as too long
                self._skipping = False
            elif len(line) > LONGEST_LINE:
                events.append(_too_long())
            elif (event := self._line(line)) is not None:
                events.append(event)
        if len(rest) > LONGEST_LINE:
            if not self._skipping:
                events.append(_too_long())
            self._skipping, rest = True, b""
        self._rest = rest
        return events

    def restart(self) -> None:
        """Forget the unfinished line."""
        self._rest, self._skipping = b"", False

    def advice(self) -> str:
        """The expected columns of a line, as a hint."""
        return "The lines carry blank fields, nan or 0,0,0 for every marker: look for occluded markers at the sender."

    def _line(self, line: bytes) -> Event | None:
        text = line.strip()
        if not text or text.startswith(b"#"):
            return None
        body, star, checksum = text.partition(b"*")
        if star:
            if not _checksum_matches(body, checksum):
                return _malformed(text, f"checksum is not {_checksum(body):02X}")
        elif self._checksum_required:
            return _malformed(text, "has no checksum")
        if body[:5].upper() == b"FRAME":
            body = body[5:].lstrip(b" ,")
        if body.translate(None, _LEGAL):
            return _malformed(text, "holds characters that are not part of a number")
        fields = body.split(b",")
        if len(fields) != self._fields:
            return _malformed(text, f"has {len(fields)} fields, not {self._fields}")
        return _frame(text, fields)


def marker_line(number: int, positions: Sequence[Position | None]) -> bytes:
    """The line of a frame, with its checksum; positions in m, None where occluded. Keeps every digit."""
    fields = [",,," if place is None else f",{place[0]!r},{place[1]!r},{place[2]!r}" for place in positions]
    body = (str(number) + "".join(fields)).encode("ascii")
    return b"%s*%02X\n" % (body, _checksum(body))


def _frame(text: bytes, fields: list[bytes]) -> Event:
    if not fields[0].strip().isdigit():
        return _malformed(text, "does not start with a frame counter")
    if len(fields[0]) > 20 or int(fields[0]) > HIGHEST:
        return _malformed(text, f"has a frame counter of more than {HIGHEST}")
    positions: list[Position | None] = []
    for at in range(1, len(fields), 3):
        x, y, z = fields[at : at + 3]
        try:
            position = (float(x), float(y), float(z))
        except ValueError:
            if x.strip() or y.strip() or z.strip():
                return _malformed(text, f"marker {at // 3 + 1} is not three numbers or three blanks")
            positions.append(None)
            continue
        if not is_place(position):
            positions.append(None)
        elif plausible(position):
            positions.append(position)
        else:
            return _malformed(text, f"marker {at // 3 + 1} is not within a kilometre")
    return DecodedFrame(int(fields[0]), tuple(positions))


def _checksum(body: bytes) -> int:
    return reduce(xor, body, 0)


def _checksum_matches(body: bytes, digits: bytes) -> bool:
    try:
        return len(digits) == 2 and int(digits, 16) == _checksum(body)
    except ValueError:
        return False


def _malformed(text: bytes, problem: str) -> Malformed:
    shown = text[:_SHOWN].decode("ascii", "backslashreplace") + ("…" if len(text) > _SHOWN else "")
    return Malformed(f"line '{shown}' {problem}")


def _too_long() -> Malformed:
    return Malformed(f"a line of more than {LONGEST_LINE} bytes")
