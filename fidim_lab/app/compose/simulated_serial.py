"""The serial devices of a rig file, simulated on pseudo terminals under the names that the file gives."""

import contextlib
from collections.abc import Callable
from functools import partial
from pathlib import Path

from drivers.ports import Clock
from drivers.serial_line.template import LineTemplate
from fidim_lab.app.compose.loop import running
from fidim_lab.data.rigs.rig import RigFile
from fidim_lab.data.rigs.rig_serial import GaugeEntry, Loading, ReleaseEntry
from fidim_lab.errors import SetupError
from sim_backends.laboratory import Laboratory
from sim_backends.magnet import SimulatedMagnet
from sim_backends.serial_devices.gauge import SimulatedGauge
from sim_backends.serial_devices.release import ReleaseTalk, SimulatedRelease

DECIMALS = 4
PULL = 0.05
"""m by which a release that fetches the platform itself pulls it aside"""

SerialSimulators = tuple[SimulatedRelease | SimulatedGauge, ...]


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
