"""The drivers of a rig file's serial devices: the release, load cells, inclinometer."""

import contextlib
from dataclasses import dataclass

from drivers.ports import Clock
from drivers.serial_line.gauge import LineGauge
from drivers.serial_line.release import SerialRelease
from fidim_lab.app.compose.loop import running
from fidim_lab.data.rigs.rig import RigFile
from fidim_lab.errors import SetupError


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
