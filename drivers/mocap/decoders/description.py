"""A decoder as a value for a file, and back: raw recordings can be decoded by the same decoder later."""

from dataclasses import dataclass
from typing import Literal

from drivers.mocap.decoders.decoder import Decoder, Position
from drivers.mocap.decoders.marker_text import MarkerTextDecoder
from drivers.mocap.decoders.natnet import NatNetDecoder
from drivers.mocap.decoders.osc import OscDecoder
from drivers.mocap.decoders.qtm import QtmDecoder
from drivers.mocap.decoders.upright import Upright
from drivers.mocap.decoders.vicon_datastream import ViconDataStreamDecoder
from drivers.mocap.decoders.vicon_udp import MarkerObjects, SubjectPoints, ViconUdpDecoder
from fidim_lab.errors import OurBugError


@dataclass(frozen=True)
class DecoderDescription:
    """A decoder by name, with its settings."""

    kind: Literal["vicon-udp", "marker-text", "vicon-datastream", "qtm", "osc", "natnet"]
    markers: int
    objects: tuple[str, ...] = ()
    """vicon-udp: an object for each marker; or the subject alone, where `points` are given. Else names or addresses"""
    points: tuple[Position, ...] = ()
    """m, in the subject's frame"""
    upright: bool = False
    """turned from y up to z up"""
    frame_address: str = "/frame"
    """osc"""
    unit: float = 1.0
    """osc: m for one unit on the wire"""
    version: tuple[int, int] | None = None
    """natnet: the server's, which it tells only once"""

    def make(self) -> Decoder:
        """A fresh decoder."""
        decoder: Decoder
        if self.kind == "marker-text":
            decoder = MarkerTextDecoder(self.markers)
        elif self.kind == "vicon-datastream":
            decoder = ViconDataStreamDecoder(self.objects)
        elif self.kind == "qtm":
            decoder = QtmDecoder(self.objects)
        elif self.kind == "natnet":
            decoder = NatNetDecoder(self.objects, self.version)
        elif self.kind == "osc":
            decoder = OscDecoder(self.objects, frame_address=self.frame_address, unit=self.unit)
        elif self.points:
            decoder = ViconUdpDecoder(SubjectPoints(self.objects[0], self.points))
        else:
            decoder = ViconUdpDecoder(MarkerObjects(self.objects))
        return Upright(decoder) if self.upright else decoder


def describe(decoder: Decoder) -> DecoderDescription:
    """The description from which `make` makes it again. Raises OurBugError for a decoder without one."""
    upright = isinstance(decoder, Upright)
    inner = decoder.inner if isinstance(decoder, Upright) else decoder
    if isinstance(inner, MarkerTextDecoder):
        return DecoderDescription("marker-text", inner.markers, upright=upright)
    if isinstance(inner, ViconDataStreamDecoder):
        return DecoderDescription("vicon-datastream", len(inner.names), inner.names, upright=upright)
    if isinstance(inner, QtmDecoder):
        return DecoderDescription("qtm", len(inner.names), inner.names, upright=upright)
    if isinstance(inner, NatNetDecoder):
        return DecoderDescription("natnet", len(inner.names), inner.names, upright=upright, version=inner.version)
    if isinstance(inner, OscDecoder):
        return DecoderDescription(
            "osc",
            len(inner.addresses),
            inner.addresses,
            upright=upright,
            frame_address=inner.frame_address,
            unit=inner.unit,
        )
    if isinstance(inner, ViconUdpDecoder):
        layout = inner.layout
        if isinstance(layout, SubjectPoints):
            return DecoderDescription("vicon-udp", len(layout.points), layout.objects, layout.points, upright)
        return DecoderDescription("vicon-udp", len(layout.objects), layout.objects, upright=upright)
    raise OurBugError(
        f"The decoder {type(inner).__name__} cannot be described.", hint="Add it to drivers.mocap.decoders.description."
    )
