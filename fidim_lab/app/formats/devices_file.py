"""devices.json, "fidim-devices/1": how the devices of a run were set up, so that its raw bytes can be read later.

Winches with all their settings and each object that bring-up wrote or compared (wanted, found, found at the end);
motion capture with its decoder. Written when a run begins, and again when it has ended.
"""

import asyncio
import shutil
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Literal

from pydantic import TypeAdapter

from drivers.cia402.dictionary import GENERIC_EDS, Graded, Met, WinchConfig
from drivers.cia402.motion import Cia402Winch
from drivers.mocap.decoders import DecoderDescription, describe
from drivers.mocap.source import StreamMarkerSource
from drivers.ports import DriveState, Rig
from fidim_lab.data.files.json_file import write_json
from fidim_lab.data.files.mistakes import read_json_as
from fidim_lab.errors import DeviceError
from procedures.recording.disk import disk_error

DEVICES = "devices.json"
EDS_FOLDER = "eds"
FORMAT = "fidim-devices/1"


@dataclass(frozen=True)
class DriveObject:
    """One object of a drive."""

    object: str
    """index:sub, hexadecimal"""
    meaning: str
    wanted: str
    before: str
    """as read back in bring-up"""
    after: str | None = None
    """as read when the run had ended; None where it was not, or the drive did not answer"""


@dataclass(frozen=True)
class GradeLine:
    """How a drive met one requirement."""

    requirement: str
    grade: str
    met: str
    found: str
    instead: str = ""
    """what takes its place; empty where the drive has it"""


@dataclass(frozen=True)
class WinchDevices:
    """One winch."""

    config: WinchConfig
    parameters: tuple[DriveObject, ...] = ()
    grades: tuple[GradeLine, ...] = ()


@dataclass(frozen=True)
class MarkersEntry:
    """Motion capture."""

    rate: float
    """Hz"""
    decoder: DecoderDescription


@dataclass(frozen=True)
class Devices:
    """The whole file."""

    winches: tuple[WinchDevices, ...]
    markers: MarkersEntry | None
    format: Literal["fidim-devices/1"] = FORMAT


_DEVICES: TypeAdapter[Devices] = TypeAdapter(Devices)


def devices_of(rig: Rig) -> Devices:
    """The devices of a rig as they are set up now; those of other makes than ours are left out."""
    winches = tuple(_winch(winch) for winch in rig.winches if isinstance(winch, Cia402Winch))
    source = rig.markers
    markers = MarkersEntry(source.rate, describe(source.decoder)) if isinstance(source, StreamMarkerSource) else None
    return Devices(winches, markers)


async def read_back(rig: Rig) -> Devices:
    """`devices_of`, with each drive's objects read once more, all drives at once.

    One that does not answer is left without `after`; nobody waits for one that is known to be silent.
    """
    found = devices_of(rig)
    winches = [winch for winch in rig.winches if isinstance(winch, Cia402Winch)]
    read = [_read_again(winch, entry) for winch, entry in zip(winches, found.winches, strict=True)]
    return replace(found, winches=tuple(await asyncio.gather(*read)))


def write_devices(folder: Path, devices: Devices) -> None:
    """The file, and the EDS files that its drives were read by. Raises HardwareError when the disk fails."""
    path = folder / DEVICES
    try:
        for winch in devices.winches:
            _keep_eds(folder, winch.config)
        write_json(path, _DEVICES.dump_python(devices, mode="json"))
    except OSError as error:
        raise disk_error(path, error) from error


def read_devices(folder: Path) -> Devices:
    """Raises FileError where it is missing or wrong. Where no EDS file was kept and its own is gone, ours stands in."""
    path = folder / DEVICES
    devices = read_json_as(path, _DEVICES.validate_python)
    return replace(devices, winches=tuple(replace(w, config=_with_eds(folder, w.config)) for w in devices.winches))


def _winch(winch: Cia402Winch) -> WinchDevices:
    checks = [asdict(check) for check in winch.checks]
    parameters = [DriveObject(c["object"], c["meaning"], c["wanted"], c["found"]) for c in checks]
    return WinchDevices(winch.config, tuple(parameters), tuple(map(_line, winch.grades)))


def _line(graded: Graded) -> GradeLine:
    requirement = graded.requirement
    instead = requirement.instead if graded.met is Met.HOST else ""
    return GradeLine(requirement.key, requirement.grade, graded.met, graded.found, instead)


async def _read_again(winch: Cia402Winch, entry: WinchDevices) -> WinchDevices:
    sample = winch.latest()
    if sample is None or sample.state is DriveState.UNKNOWN:
        return entry
    parameters: list[DriveObject] = []
    for parameter in entry.parameters:
        index, sub = (int(part, 16) for part in parameter.object.split(":"))
        try:
            after = str(await winch.link.sdo.read(index, sub))
        except DeviceError:
            return replace(entry, parameters=(*parameters, *entry.parameters[len(parameters) :]))
        parameters.append(replace(parameter, after=after))
    return replace(entry, parameters=tuple(parameters))


def _kept_eds(folder: Path, config: WinchConfig) -> Path:
    return folder / EDS_FOLDER / f"node{config.node_id}.eds"


def _keep_eds(folder: Path, config: WinchConfig) -> None:
    """A maker's dictionary says what its drive's PDOs carry: without it the raw bus log could not be read elsewhere."""
    kept = _kept_eds(folder, config)
    if config.eds == GENERIC_EDS or kept.exists() or not config.eds.exists():
        return
    kept.parent.mkdir(exist_ok=True)
    shutil.copyfile(config.eds, kept)


def _with_eds(folder: Path, config: WinchConfig) -> WinchConfig:
    kept = _kept_eds(folder, config)
    if kept.is_file():
        return config.changed(eds=kept)
    return config if config.eds.exists() else config.changed(eds=GENERIC_EDS)
