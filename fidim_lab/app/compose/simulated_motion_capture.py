"""Motion capture and serial devices of a rig file, simulated: the bytes of their kind, sent as that kind sends them."""

import contextlib
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Protocol

import numpy as np

from drivers.mocap.decoders import address_of
from drivers.mocap.decoders.decoder import UNLABELLED
from drivers.ports import Clock
from drivers.serial_line.template import LineTemplate
from fidim_lab.app.compose.loop import running
from fidim_lab.data.records import Robot
from fidim_lab.data.rigs.rig import MocapEntry, RigFile
from fidim_lab.data.rigs.rig_serial import GaugeEntry, Loading, ReleaseEntry
from fidim_lab.data.rigs.rig_tables import MocapKind
from fidim_lab.errors import SetupError
from sim_backends.laboratory import Laboratory
from sim_backends.magnet import SimulatedMagnet
from sim_backends.mocap.datastream import DataStreamEncoder, DataStreamSession
from sim_backends.mocap.encoders import (
    Encoder,
    OscEncoder,
    TextEncoder,
    TurnedEncoder,
    ViconEncoder,
    ViconSubjectEncoder,
)
from sim_backends.mocap.lsl_sender import LslSender
from sim_backends.mocap.natnet import NatNetEncoder, NatNetServer
from sim_backends.mocap.qtm import QtmEncoder, QtmSession
from sim_backends.mocap.sockets import PlainSession, Session, TcpServer, UdpSender
from sim_backends.serial_devices.gauge import SimulatedGauge
from sim_backends.serial_devices.release import ReleaseTalk, SimulatedRelease

DECIMALS = 4
PULL = 0.05
"""m by which a release that fetches the platform itself pulls it aside"""

SerialSimulators = tuple[SimulatedRelease | SimulatedGauge, ...]

SUBJECT = "platform"
"""what carries markers that are named without a subject"""


ARM = 0.25
"""m from the main marker to two points more, by which the pose of a tracked body is seen"""


class MocapSender(Protocol):
    """A simulated system at its socket or stream."""

    async def start(self) -> None:
        """Begin to send. Raises SetupError where the address is taken."""
        ...

    async def close(self) -> None:
        """Stop; may be called twice."""
        ...


def mocap_sender(file: RigFile, laboratory: Laboratory, clock: Clock) -> MocapSender:
    """What sends the markers of a laboratory as the rig file's system would. Raises SetupError where it cannot."""
    entry = file.motion_capture
    encoder = _encoder(entry, file.robot)
    server = laboratory.mocap_server(_turned(encoder, entry), entry.rate)
    if entry.kind is MocapKind.LSL:
        if entry.up != "z" or entry.unit != 1.0:
            raise SetupError("motion_capture, up, unit: the simulated LSL stream has z up and metres.")
        return LslSender(server, clock, entry.stream or "", entry.markers)
    if isinstance(encoder, NatNetEncoder):
        return NatNetServer(server, encoder.about(), clock, entry.port, entry.host)
    if entry.transport == "tcp":
        return TcpServer(server, clock, entry.port, entry.host, _session(entry))
    host = "127.0.0.1" if entry.host == "0.0.0.0" else entry.host
    return UdpSender(server, clock, entry.port, host)


def as_cameras_see(file: RigFile) -> RigFile:
    """The same, with the points of its robot by which a tracked body is seen, where the rig has such."""
    if file.motion_capture.kind is not MocapKind.VICON_UDP or file.motion_capture.subject is None:
        return file
    robot = file.robot
    more = (robot.marker + np.array([ARM, 0.0, 0.0]), robot.marker + np.array([0.0, ARM, 0.0]))
    return replace(file, robot=replace(robot, extra_markers=(*robot.extra_markers, *more)))


def _session(entry: MocapEntry) -> Callable[[], Session]:
    match entry.kind:
        case MocapKind.VICON_DATASTREAM:
            return DataStreamSession
        case MocapKind.QTM:
            return QtmSession.maker(entry.markers)
        case _:
            return PlainSession


def _turned(encoder: Encoder, entry: MocapEntry) -> Encoder:
    return TurnedEncoder(encoder) if entry.up == "y" else encoder


def _encoder(entry: MocapEntry, robot: Robot) -> Encoder:
    if UNLABELLED in entry.markers:
        raise SetupError(f'motion_capture, markers: "{UNLABELLED}" is not simulated; name the marker to rehearse it.')
    match entry.kind:
        case MocapKind.VICON_DATASTREAM:
            parts = [name.rpartition("/") for name in entry.markers]
            subjects = {subject or SUBJECT for subject, _, _ in parts}
            if len(subjects) > 1:
                found = ", ".join(sorted(subjects))
                raise SetupError(f"motion_capture, markers: one subject is simulated, these are of {found}.")
            return DataStreamEncoder([name for _, _, name in parts], subject=subjects.pop(), rate=entry.rate)
        case MocapKind.QTM:
            return QtmEncoder(entry.rate)
        case MocapKind.NATNET:
            pairs = [name.partition("/") for name in entry.markers]
            return NatNetEncoder([(int(asset), int(number)) for asset, _, number in pairs])
        case MocapKind.OSC:
            addresses = [address_of(marker) for marker in entry.markers]
            return OscEncoder(addresses, frame_address=entry.frame_address, unit=entry.unit)
        case MocapKind.VICON_UDP if entry.subject is not None:
            return ViconSubjectEncoder(entry.subject, [point.tolist() for point in robot.markers])
        case MocapKind.VICON_UDP:
            return ViconEncoder(entry.markers)
        case _:
            return TextEncoder()


def serial_simulators(file: RigFile, laboratory: Laboratory, clock: Clock) -> SerialSimulators:
    """The devices, not yet living. Raises SetupError for a port that only hardware has."""
    devices: list[SimulatedRelease | SimulatedGauge] = []
    if file.release is not None:
        if file.release.loading is Loading.BY_ITSELF:
            laboratory.magnet.fetches = PULL
        devices.append(_release(file.release, laboratory.magnet, clock))
    for entry in file.gauges:
        line = _line(entry, laboratory, clock)
        devices.append(SimulatedGauge(serial_link(entry.port), entry.baud, clock, entry.rate, line, entry.ask))
    return tuple(devices)


async def run_serial_simulators(stack: contextlib.AsyncExitStack, devices: SerialSimulators) -> None:
    """Plug them in, and let them live until the context ends. Raises SetupError where a name is taken."""
    for device in devices:
        device.line.plug()
        await running(stack, device.run())


def _release(entry: ReleaseEntry, magnet: SimulatedMagnet, clock: Clock) -> SimulatedRelease:
    talk = ReleaseTalk(entry.hold, entry.release, entry.ask, entry.holds, entry.released)
    return SimulatedRelease(serial_link(entry.port), entry.baud, clock, magnet, talk, entry.watchdog)


def _line(entry: GaugeEntry, laboratory: Laboratory, clock: Clock) -> Callable[[], str]:
    template = LineTemplate(entry.pattern)
    sense = laboratory.inclination if "x" in entry.columns else laboratory.load_cells
    return partial(_say, entry, template, lambda: sense(clock.now(), entry.uncertainty))


def _say(entry: GaugeEntry, template: LineTemplate, sense: Callable[[], dict[str, float]]) -> str:
    values = sense()
    shown = {name: f"{(values[name] - entry.offset) / entry.scale:.{DECIMALS}f}" for name in entry.columns}
    return template.write(shown, anything="OK")


def serial_link(port: str) -> Path:
    """The name of a simulated line. Raises SetupError for one that only hardware has."""
    if "://" in port or "/" not in port or port.startswith("/dev/"):
        raise SetupError(
            f"The serial port {port} belongs to hardware: simulated devices are not put there.",
            hint="Use a name of its own, such as /tmp/fidim/release, or one beside the rig file.",
        )
    return Path(port)
