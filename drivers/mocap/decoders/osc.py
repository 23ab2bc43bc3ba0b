"""Open Sound Control over UDP: one bundle is one frame (OSC 1.0). The rig file says the addresses.

    bundle    "#bundle", time tag, then elements, each with its size: messages or bundles
    message   address, type tags (",fff"), arguments; texts end with NUL and fill up to 4 bytes; big endian

One message of the bundle carries the frame number as its first argument; one for each marker that is seen carries
x, y, z as its first three. A marker without a message, at NaN or at 0, 0, 0 is occluded. Time tags are not used.
"""

import struct
from dataclasses import dataclass

from drivers.mocap.decoders.decoder import DecodedFrame, Event, Malformed, Position, is_place, plausible

FRAME_ADDRESS = "/frame"
MARKER_ADDRESS = "/marker/{}"
DEEPEST = 8
"""bundles in bundles"""
_BUNDLE = b"#bundle\0"
_NUMBERS = {"i": struct.Struct(">i"), "f": struct.Struct(">f"), "h": struct.Struct(">q"), "d": struct.Struct(">d")}
_SIZES = {"c": 4, "r": 4, "m": 4, "t": 8}
_EMPTY = "TFNI"


@dataclass(frozen=True, slots=True)
class OscMessage:
    """One message; arguments that are no numbers are None."""

    address: str
    arguments: tuple[float | None, ...]


class _DamagedError(Exception):
    """Control flow: what is wrong with a datagram."""


def parse_osc(data: bytes) -> tuple[OscMessage, ...] | Malformed:
    """All messages of a datagram, in order, or why it is none. Never raises."""
    try:
        return tuple(_element(data, 0))
    except (_DamagedError, struct.error) as error:
        return Malformed(f"OSC datagram of {len(data)} bytes: {error}")


def address_of(marker: str) -> str:
    """A marker's address: the name itself where it is one, else /marker/NAME."""
    return marker if marker.startswith("/") else MARKER_ADDRESS.format(marker)


class OscDecoder:
    """Decoder of bundles with a frame number and marker messages at given addresses, main marker first."""

    modulus = 1 << 32

    def __init__(self, addresses: tuple[str, ...], *, frame_address: str = FRAME_ADDRESS, unit: float = 1.0) -> None:
        """unit: m for one unit on the wire."""
        self.addresses = addresses
        self.frame_address = frame_address
        self.unit = unit
        self._others: set[str] = set()

    def receive(self, data: bytes) -> list[Event]:
        """One event for one datagram."""
        messages = parse_osc(data)
        if isinstance(messages, Malformed):
            return [messages]
        by_address: dict[str, OscMessage] = {}
        for message in messages:
            by_address.setdefault(message.address, message)
        frame = by_address.get(self.frame_address)
        number = frame.arguments[0] if frame is not None and frame.arguments else None
        if number is None or number != number // 1:
            self._remember(by_address)
            return [Malformed(f"OSC: no message {self.frame_address} with a whole number in a bundle")]
        positions: list[Position | None] = []
        for address in self.addresses:
            position = self._position(by_address.get(address))
            if isinstance(position, Malformed):
                return [position]
            positions.append(position)
        if None in positions:
            self._remember(by_address)
        return [DecodedFrame(int(number) % self.modulus, tuple(positions))]

    def restart(self) -> None:
        """Nothing to forget: a datagram is whole or malformed."""

    def advice(self) -> str:
        """Names the addresses that come beside those that are wanted."""
        others = ", ".join(sorted(self._others)) or "no other address"
        return f"Wanted are {', '.join(self.addresses)}; besides, the bundles carry {others}."

    def _position(self, message: OscMessage | None) -> Position | Malformed | None:
        if message is None:
            return None
        x, y, z, *_ = (*message.arguments, None, None, None)
        if x is None or y is None or z is None:
            return Malformed(f"OSC: {message.address} does not begin with three numbers")
        position = (x * self.unit, y * self.unit, z * self.unit)
        if not is_place(position):
            return None
        if plausible(position):
            return position
        return Malformed(f"OSC: {message.address} is more than a kilometre away")

    def _remember(self, messages: dict[str, OscMessage]) -> None:
        if len(self._others) < 16:  # bounded: damaged datagrams could carry ever new ones
            self._others.update(address for address in messages if address not in self.addresses)


def _element(data: bytes, depth: int) -> list[OscMessage]:
    if not data.startswith(_BUNDLE):
        return [_message(data)]
    if depth >= DEEPEST:
        raise _DamagedError(f"more than {DEEPEST} bundles in one another")
    found: list[OscMessage] = []
    at = 16
    while at < len(data):
        (size,) = struct.unpack_from(">i", data, at)
        at += 4
        if size < 0 or at + size > len(data):
            raise _DamagedError(f"an element of {size} bytes at byte {at}")
        found += _element(data[at : at + size], depth + 1)
        at += size
    return found


def _message(data: bytes) -> OscMessage:
    if not data.startswith(b"/"):
        raise _DamagedError("neither a bundle nor an address begins it")
    address, at = _text(data, 0)
    tags, at = _text(data, at)
    if not tags.startswith(","):
        raise _DamagedError(f"{address} has no type tags")
    arguments: list[float | None] = []
    for tag in tags[1:]:
        number, at = _argument(data, at, tag)
        arguments.append(number)
    return OscMessage(address, tuple(arguments))


def _argument(data: bytes, at: int, tag: str) -> tuple[float | None, int]:
    if (layout := _NUMBERS.get(tag)) is not None:
        return layout.unpack_from(data, at)[0], at + layout.size
    if tag in "sS":
        return None, _text(data, at)[1]
    if tag == "b":
        (size,) = struct.unpack_from(">i", data, at)
        return None, at + 4 + -(-max(size, 0) // 4) * 4
    if tag in _EMPTY:
        return None, at
    if tag in _SIZES:
        return None, at + _SIZES[tag]
    raise _DamagedError(f"an argument of unknown type {tag!r}")


def _text(data: bytes, at: int) -> tuple[str, int]:
    end = data.find(b"\0", at)
    if end < 0:
        raise _DamagedError(f"a text at byte {at} does not end")
    return data[at:end].decode("ascii", "replace"), (end // 4 + 1) * 4
