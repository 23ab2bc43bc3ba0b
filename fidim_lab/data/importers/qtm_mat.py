"""Qualisys Track Manager's MAT export: one struct with FrameRate, Trajectories.Labeled and RigidBodies.

    Trajectories.Labeled.Data   markers × 4 × frames, mm (the fourth is the residual); Labels
    RigidBodies.Positions       bodies × 3 × frames, mm; Rotations  bodies × 9 × frames, column by column; Name

Not seen is NaN. Every mistake is a FileError naming the field.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fidim_lab.data.importers.reading.cells import MIN_FRAMES
from fidim_lab.data.importers.reading.clock import check_rate
from fidim_lab.data.importers.reading.labels import apart
from fidim_lab.data.importers.reading.matlab import MatStruct, load_struct, variables
from fidim_lab.data.importers.reading.poses import by_matrices
from fidim_lab.data.importers.recording import BodyTrack, MarkerLog
from fidim_lab.errors import FileError

SCALE = 1e-3
OTHERS = "fidim import csv reads arrays of MATLAB files that QTM did not write."


def read_qtm_mat(path: Path) -> MarkerLog:
    """Read one export. Raises FileError naming the field."""
    names = variables(path)
    if len(names) != 1:
        found = ", ".join(names)[:120] or "none"
        raise FileError(path, "", f"variables {found}; QTM exports one struct.", hint=OTHERS)
    root = load_struct(path, names[0])
    if "FrameRate" not in root.fields:
        what = f"is missing; found {', '.join(root.fields)[:120] or 'nothing'}."
        raise FileError(path, f"{names[0]}.FrameRate", what, hint=OTHERS)
    rate = check_rate(path, root.number("FrameRate"))
    bodies: Sequence[BodyTrack] = _bodies(root) if isinstance(root.fields.get("RigidBodies"), dict) else ()
    groups = root.fields.get("Trajectories")
    labels: tuple[str, ...] = ()
    loose = positions = None
    if isinstance(groups, dict):
        trajectories = root.struct("Trajectories")
        if isinstance(groups.get("Labeled"), dict):
            labelled = trajectories.struct("Labeled")
            labels = labelled.texts("Labels")
            positions = _places(labelled, len(labels))
        if isinstance(spare := groups.get("Unidentified"), dict) and np.size(
            spare.get("Data", ())
        ):  # MATLAB's [] where there is none
            loose = _places(trajectories.struct("Unidentified"), None)
    if positions is None and not bodies:
        raise FileError(path, names[0], "neither Trajectories.Labeled nor RigidBodies.", hint="Export 3D or 6D data.")
    frames = len(next(iter(bodies)).positions) if positions is None else len(positions)
    if frames < MIN_FRAMES:
        raise FileError(path, "", f"{frames} frames; a recording has at least {MIN_FRAMES}")
    if any(len(body.positions) != frames for body in bodies) or (loose is not None and len(loose) != frames):
        raise FileError(path, names[0], "markers and bodies have different numbers of frames")
    positions = np.zeros((frames, 0, 3)) if positions is None else positions
    labels, positions, again = apart(labels, positions)
    pieces = [part for part in (again, loose) if part is not None]
    loose = np.concatenate(pieces, axis=1) if pieces else None
    said = (f"lengths in mm and z upwards, as QTM exports them by default; {rate:g} Hz by FrameRate",)
    t = np.arange(frames) / rate
    return MarkerLog(path, labels, rate, t, positions, SCALE, "z", said, tuple(bodies), loose)


def _places(owner: MatStruct, count: int | None) -> np.ndarray:
    """(N, M, 3) m."""
    data = owner.samples("Data", count, 4, None)
    return SCALE * data[:, :3].transpose(2, 0, 1)


def _bodies(root: MatStruct) -> tuple[BodyTrack, ...]:
    owner = root.struct("RigidBodies")
    if not (names := owner.texts("Name")):
        return ()
    positions = owner.samples("Positions", len(names), 3, None)
    rotations = owner.samples("Rotations", len(names), 9, None)
    if positions.shape[2] != rotations.shape[2]:
        raise FileError(root.path, "RigidBodies", "Positions and Rotations have different numbers of frames")
    return tuple(
        by_matrices(root.path, name, SCALE * positions[k].T, rotations[k].T.reshape(-1, 3, 3).swapaxes(1, 2))
        for k, name in enumerate(names)
    )
