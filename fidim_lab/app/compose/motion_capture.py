"""Motion capture and serial devices that a rig file names: what reads their bytes, and where those come from."""

import contextlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from drivers.mocap.asked_udp import AskedUdpFeed, Greeting
from drivers.mocap.decoders import (
    Decoder,
    MarkerObjects,
    MarkerTextDecoder,
    NatNetDecoder,
    OscDecoder,
    QtmDecoder,
    Upright,
    ViconDataStreamDecoder,
    ViconUdpDecoder,
    address_of,
)
from drivers.mocap.decoders.natnet import hello, invitation, keep_alive
from drivers.mocap.decoders.qtm import QtmRequests
from drivers.mocap.decoders.vicon_datastream import DataStreamWishes
from drivers.mocap.decoders.vicon_udp import SubjectPoints
from drivers.mocap.feeds import ByteFeed, Conversation, TcpFeed, UdpFeed
from drivers.mocap.lsl_feed import LslFeed
from drivers.mocap.source import StreamMarkerSource
from drivers.ports import Clock
from drivers.serial_line.gauge import LineGauge
from drivers.serial_line.release import SerialRelease
from fidim_lab.app.compose.loop import running
from fidim_lab.data.rigs.rig import MocapEntry, RigFile
from fidim_lab.data.rigs.rig_tables import MocapKind
from fidim_lab.errors import SetupError

CONVERSATIONS: Mapping[MocapKind, Callable[[], Conversation]] = {
    MocapKind.VICON_DATASTREAM: DataStreamWishes,
    MocapKind.QTM: QtmRequests,
}
"""what is said to servers that wait to be asked"""


def marker_source(file: RigFile, clock: Clock) -> StreamMarkerSource:
    """The rig's motion capture, not yet started. Raises SetupError where a package is missing that it needs."""
    entry = file.motion_capture
    decoder = marker_decoder(file)
    return StreamMarkerSource(
        _feed(entry, clock), Upright(decoder) if entry.up == "y" else decoder, clock, rate=entry.rate
    )


def marker_decoder(file: RigFile) -> Decoder:
    """What reads the bytes, in the system's own axes."""
    entry = file.motion_capture
    match entry.kind:
        case MocapKind.VICON_DATASTREAM:
            return ViconDataStreamDecoder(entry.markers)
        case MocapKind.QTM:
            return QtmDecoder(entry.markers)
        case MocapKind.NATNET:
            return NatNetDecoder(entry.markers)
        case MocapKind.OSC:
            addresses = tuple(address_of(marker) for marker in entry.markers)
            return OscDecoder(addresses, frame_address=entry.frame_address, unit=entry.unit)
        case MocapKind.VICON_UDP if entry.subject is not None:
            points = tuple((float(x), float(y), float(z)) for x, y, z in file.robot.markers)
            return ViconUdpDecoder(SubjectPoints(entry.subject, points))
        case MocapKind.VICON_UDP:
            return ViconUdpDecoder(MarkerObjects(entry.markers))
        case _:  # lines of text, and the samples of LSL, which its feed makes lines of text
            return MarkerTextDecoder(len(file.robot.markers))


def _feed(entry: MocapEntry, clock: Clock) -> ByteFeed:
    if entry.kind is MocapKind.LSL:
        stream, sender = entry.stream or "", entry.sender
        return LslFeed(clock, stream, entry.markers, rate=entry.rate, unit=entry.unit, sender=sender)
    if entry.kind is MocapKind.NATNET:
        return AskedUdpFeed(clock, entry.host, entry.port, Greeting(hello(), keep_alive()), invitation)
    if entry.transport == "tcp":
        return TcpFeed(clock, entry.host, entry.port, conversation=CONVERSATIONS.get(entry.kind))
    return UdpFeed(clock, entry.port, entry.host, sender=entry.sender)


@dataclass(frozen=True)
class SerialDevices:
    """Those that a rig has."""

    release: SerialRelease | None
    gauges: tuple[LineGauge, ...]


def serial_devices(file: RigFile, clock: Clock) -> SerialDevices:
    """The drivers, not yet running. Raises SetupError naming the rig file for a pattern that is none."""
    try:
        gauges = tuple(LineGauge(entry, clock) for entry in file.gauges)
    except SetupError as error:
        raise SetupError(f"{file.path}: {error.message}", hint=error.hint) from error
    return SerialDevices(None if file.release is None else SerialRelease(file.release, clock), gauges)


async def run_serial_devices(stack: contextlib.AsyncExitStack, devices: SerialDevices) -> None:
    """Keep them connected until the context ends."""
    for device in (*((devices.release,) if devices.release else ()), *devices.gauges):
        await running(stack, device.run())
