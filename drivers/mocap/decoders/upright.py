"""A motion-capture frame whose y axis points up, turned so that z does: (x, y, z) → (x, −z, y)."""

from drivers.mocap.decoders.decoder import DecodedFrame, Decoder, Event, Position


class Upright:
    """A decoder whose positions are turned by +90° about x; all else is the inner decoder's."""

    def __init__(self, decoder: Decoder) -> None:
        self.inner = decoder
        """what reads the bytes"""

    @property
    def modulus(self) -> int | None:
        """The inner decoder's."""
        return self.inner.modulus

    def receive(self, data: bytes) -> list[Event]:
        """Its events, frames turned."""
        return [_turned(event) if isinstance(event, DecodedFrame) else event for event in self.inner.receive(data)]

    def restart(self) -> None:
        """The inner decoder's."""
        self.inner.restart()

    def advice(self) -> str:
        """The inner decoder's."""
        return self.inner.advice()


def _turned(frame: DecodedFrame) -> DecodedFrame:
    return DecodedFrame(frame.number, tuple([None if p is None else _upright(p) for p in frame.positions]))


def _upright(position: Position) -> Position:
    x, y, z = position
    return x, -z, y
