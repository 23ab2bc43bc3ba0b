"""Recordings of the IRMA4U robot (University of Bologna): Vicon text export, robot log and geometry as .mat files.

Files are recognised by what they hold, not by name, so a source may be the folder or the single files:

    *.txt with "Trajectories"        markers, mm, 100 Hz
    *.mat with `st_out`              robot log, 1 kHz: t, cable_length, swivel, tensions, epsilon (inclinometer)
    *.mat with `s.EndEffector`       geometry and nominal body: pulleys, attachments, mass, PtoG, InertialMatrix

`cable_length` counts from wherever the encoders were zeroed; `InertialMatrix` is about the centre of mass (with it
about P the nominal body would be impossible); axes of `FixedFrame` are x, y and the swivel axis z of spec/model.md §1.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fidim_lab.data.files.input_file import TEXT_LIMIT, open_input
from fidim_lab.data.importers.reading.matlab import MatStruct, load_struct, variables
from fidim_lab.data.importers.recording import Recording, RobotLog
from fidim_lab.data.importers.vicon_text import read_trajectories
from fidim_lab.data.records import Body, Cable, Robot
from fidim_lab.errors import FileError, SetupError

KIND = "irma4u"
LOG, GEOMETRY = "st_out", "s"
PREFERRED_GEOMETRY = "UACDPR_LAB3.mat"
"""the robot's CAD; a folder may also hold later calibrations, which are used when named as a source"""
GRAVITY = 9.80665
"""m/s²; the weight in the CAD file is its mass times this"""
ORTHONORMAL = 1e-6
MIN_LOG = 1000
"""samples, 1 s"""


@dataclass(frozen=True)
class RecordingFiles:
    """The three files of one recording."""

    markers: Path
    log: Path
    geometry: Path


def read_irma4u(sources: Sequence[Path]) -> Recording:
    """Read one recording from folders and files; a file named itself wins over those found in a folder.

    Raises SetupError where a part is missing or not unique, FileError with file and field where one is wrong.
    """
    files = find_sources(sources)
    robot = read_geometry(files.geometry)
    return Recording(
        kind=KIND,
        name=files.markers.stem,
        robot=robot,
        geometry_source=files.geometry,
        markers=read_trajectories(files.markers),
        log=read_log(files.log, robot.n),
    )


def find_sources(sources: Sequence[Path]) -> RecordingFiles:
    """Which of the given files, or of those in the given folders, is what."""
    named: dict[str, list[Path]] = {"markers": [], "log": [], "geometry": []}
    found: dict[str, list[Path]] = {"markers": [], "log": [], "geometry": []}
    for source in sources:
        if not source.exists():
            raise FileError(source, "", "no such file or folder")
        for path in sorted(source.iterdir()) if source.is_dir() else [source]:
            role = _role(path)
            if role is not None:
                (found if source.is_dir() else named)[role].append(path)
            elif not source.is_dir():
                raise FileError(
                    path, "", "is neither a trajectory export, a robot log (st_out) nor a geometry file (s)"
                )
    preferred = [path for path in found["geometry"] if path.name == PREFERRED_GEOMETRY]
    found["geometry"] = preferred or found["geometry"]
    chosen = {role: _single(role, named[role] or found[role], sources) for role in named}
    return RecordingFiles(**chosen)


def _role(path: Path) -> str | None:
    if path.suffix.lower() == ".txt":
        with open_input(path, TEXT_LIMIT) as file:
            return "markers" if file.read(15).lstrip(b"\xef\xbb\xbf").startswith(b"Trajectories") else None
    if path.suffix.lower() == ".mat":
        names = variables(path)
        return "log" if LOG in names else "geometry" if GEOMETRY in names else None
    return None


def _single(role: str, paths: Sequence[Path], sources: Sequence[Path]) -> Path:
    says = {
        "markers": "marker export (.txt)",
        "log": f"robot log (.mat with {LOG})",
        "geometry": "geometry file (.mat)",
    }
    if not paths:
        raise SetupError(f"No {says[role]} in {', '.join(str(s) for s in sources)}.")
    if len(set(paths)) > 1:
        raise SetupError(
            f"More than one {says[role]}: {', '.join(path.name for path in paths)}.",
            hint="Name the one to use after the folder.",
        )
    return paths[0]


def read_geometry(path: Path) -> Robot:
    """Robot of a geometry file; its `marker` is a placeholder at P. Raises FileError naming the field."""
    content = load_struct(path, GEOMETRY)
    platform = content.struct("EndEffector").struct("Platform")
    attachments = platform.cells("points", 3)
    pulleys = content.struct("Trasmission").structs("Pulley")
    if len(attachments) != len(pulleys) or not 1 <= len(pulleys) <= 5:
        raise FileError(path, "s", f"{len(pulleys)} pulleys and {len(attachments)} attachment points; 1 to 5 of each")
    mass = platform.number("m")
    if mass <= 0.0:
        raise FileError(path, "s.EndEffector.Platform.m", f"a mass of {mass:g} kg; it must be positive")
    com = platform.array("PtoG", 3)
    about_com = platform.array("InertialMatrix", 3, 3)
    if np.linalg.eigvalsh(about_com)[0] <= 0.0 or not np.allclose(about_com, about_com.T):
        raise FileError(path, "s.EndEffector.Platform.InertialMatrix", "is not symmetric and positive definite")
    return Robot(
        cables=tuple(_cable(pulley, a) for pulley, a in zip(pulleys, attachments, strict=True)),
        mass=mass,
        nominal=Body.from_about_com(com, about_com / mass),
        marker=np.zeros(3),
        gravity=np.array([0.0, 0.0, -GRAVITY]),
    )


def _cable(pulley: MatStruct, attachment: np.ndarray) -> Cable:
    axes = np.array(pulley.cells("FixedFrame", 3))
    if axes.shape != (3, 3) or not np.allclose(axes @ axes.T, np.eye(3), atol=ORTHONORMAL) or np.linalg.det(axes) < 0.0:
        raise FileError(pulley.path, f"{pulley.place}.FixedFrame", "is not a right-handed set of three unit vectors")
    radius = pulley.number("r")
    if radius < 0.0:
        raise FileError(pulley.path, f"{pulley.place}.r", f"a radius of {radius:g} m; it cannot be negative")
    x, y, z = axes
    return Cable(d=pulley.array("CableEnterPosition", 3), a=attachment, radius=radius, x=x, y=y, z=z)


def read_log(path: Path, cables: int) -> RobotLog:
    """The robot's log of a platform on `cables` cables. Raises FileError naming the field."""
    content = load_struct(path, LOG)
    t = content.array("t", None)
    if len(t) < MIN_LOG:
        raise FileError(path, f"{LOG}.t", f"{len(t)} samples; a log has at least {MIN_LOG}")
    if (np.diff(t) <= 0.0).any():
        sample = int(np.argmax(np.diff(t) <= 0.0)) + 2
        raise FileError(path, f"{LOG}.t", f"time does not increase at sample {sample} ({t[sample - 1]:g} s)")
    log = RobotLog(
        source=path,
        t=t,
        lengths=content.array("cable_length", cables, len(t)).T,
        swivels=content.array("swivel", cables, len(t)).T,
        tensions=content.array("tensions", cables, len(t)).T,
        inclinometer=content.array("epsilon", 3, len(t)).T,
    )
    return replace(log, inclinometer=np.unwrap(log.inclinometer, axis=0))
