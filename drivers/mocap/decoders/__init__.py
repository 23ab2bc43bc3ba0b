"""Stream formats of motion capture, without I/O and clock: bytes in, frames and events out.

In: datagrams or pieces of a byte stream. Out: frames with their numbers, and what was wrong with the bytes.
"""

from drivers.mocap.decoders.decoder import Decoder
from drivers.mocap.decoders.description import DecoderDescription, describe
from drivers.mocap.decoders.marker_text import MarkerTextDecoder
from drivers.mocap.decoders.natnet import NatNetDecoder
from drivers.mocap.decoders.osc import OscDecoder, address_of
from drivers.mocap.decoders.qtm import QtmDecoder
from drivers.mocap.decoders.upright import Upright
from drivers.mocap.decoders.vicon_datastream import ViconDataStreamDecoder
from drivers.mocap.decoders.vicon_udp import MarkerObjects, ViconUdpDecoder

__all__ = [
    "Decoder",
    "DecoderDescription",
    "MarkerObjects",
    "MarkerTextDecoder",
    "NatNetDecoder",
    "OscDecoder",
    "QtmDecoder",
    "Upright",
    "ViconDataStreamDecoder",
    "ViconUdpDecoder",
    "address_of",
    "describe",
]
