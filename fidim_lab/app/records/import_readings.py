"""The ways in which the poses of a file may be read: which axis points upwards, which body, units, quaternions.

While the motors are locked the cable lengths do not change: of each reading it is computed how much they do. Where
none fits, readings that no file asks for are tried, so that the cause can be named: another unit, the quaternion's
numbers in another order, the rotation the other way round.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from scipy.spatial.transform import Rotation

from fidim_lab.arrays import Positions, Rotations
from fidim_lab.data.importers.reading import LENGTH_UNITS, MIN_FRAMES
from fidim_lab.data.importers.recording import BodyTrack
from fidim_lab.errors import FidimError, InfeasibleError, RefusedError
from fidim_lab.model.mechanism import Mechanism

UPRIGHT = MappingProxyType(
    {
        "z": np.eye(3),
        "y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
        "x": np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]),
    }
)
"""by the axis that points upwards in the file: what turns it to z"""
UNITS = ("m", "mm", "cm", "in")
"""of length, that are tried"""
SURVEYED = 1e-3
"""m, by which lengths of locked cables vary at most where a file is read as it was meant: 0.1 to 0.5 in 60 takes"""
FAR = 5.0
"""times as much do they vary in a wrong reading, at least: a wrong axis made 4 to 10 mm of 0.1"""
FEW = 2000
"""samples are enough to see whether lengths vary"""

Track = tuple[BodyTrack | None, Positions, Rotations]


@dataclass(frozen=True, eq=False)
class PoseReading:
    """One way to read the poses of a file, and how much the cable lengths vary in it."""

    up: str
    positions: Positions
    rotations: Rotations
    varies: float
    """m"""
    body: BodyTrack | None = None
    turned: bool = False
    """whether the body's own axes are named like the file's, too"""

    @property
    def words(self) -> str:
        """For a person."""
        axes = ", its own axes too" if self.turned else ""
        return f"{self.up} upwards{axes}" + (f" for body {self.body.name}" if self.body else "")


def readings_of(mechanism: Mechanism, tracks: Sequence[Track]) -> Iterator[PoseReading]:
    """Every upward axis, with the body's own axes named alike or not."""
    for body, positions, rotations in tracks:
        for up, turn in UPRIGHT.items():
            where, turned = positions @ turn.T, turn @ rotations
            yield PoseReading(up, where, turned, _varies(mechanism, where, turned), body)
            if body is not None and up != "z":
                own = turned @ turn.T
                yield PoseReading(up, where, own, _varies(mechanism, where, own), body, turned=True)


def _varies(mechanism: Mechanism, positions: Positions, rotations: Rotations) -> float:
    """m, robust standard deviation of the cable lengths by these poses, rms over the cables; inf with too few of them.

    A body that stands still is seen once, and lengths of one sample do not vary.
    """
    known = np.flatnonzero(np.isfinite(positions).all(axis=1))
    some = known[:: max(1, len(known) // FEW)]
    if len(some) < MIN_FRAMES:
        return float("inf")
    try:
        lengths = mechanism.lengths(positions[some], rotations[some])
    except (InfeasibleError, FidimError):
        return float("inf")
    away = 1.4826 * np.median(np.abs(lengths - np.median(lengths, axis=0)), axis=0)
    return float(np.sqrt(np.mean(away**2))) if np.isfinite(away).all() else float("inf")


def refuse_misread(mechanism: Mechanism, tracks: Sequence[Track], scale: float, varies: float) -> None:
    """Raises RefusedError that names the way to read exported poses in which the lengths of locked cables stay.

    scale: metres in one unit of the file; varies: how much they vary as the poses were read, m. Nothing is raised where
    that is little, or no other way fits.
    """
    if varies <= SURVEYED:
        return
    for track in tracks:
        for words, hint, other in _misreadings(track, scale):
            fits = min(reading.varies for reading in readings_of(mechanism, [other]))
            if fits <= SURVEYED and fits * FAR < varies:
                what = f"Cable lengths vary by {varies * 1e3:.1f} mm by the poses as read, by {fits * 1e3:.1f} mm with"
                raise RefusedError(f"{what} {words}", hint=hint)


def _misreadings(track: Track, scale: float) -> Iterator[tuple[str, str, Track]]:
    """What is changed, what to do about it, and the poses with it."""
    body, positions, rotations = track
    known = np.isfinite(rotations).all(axis=(1, 2))
    if body is None or not known.any():
        return
    for unit in UNITS:
        if not np.isclose(LENGTH_UNITS[unit], scale):
            yield f"lengths in {unit}", f"Say --unit {unit}.", (body, LENGTH_UNITS[unit] / scale * positions, rotations)
    turns: dict[str, Rotations] = {"each rotation the other way round (world to body)": rotations.swapaxes(1, 2)}
    xyzw = Rotation.from_matrix(rotations[known]).as_quat()
    for said, order in (("w, x, y, z", [1, 2, 3, 0]), ("x, y, z, w", [3, 0, 1, 2])):
        turned = rotations.copy()
        turned[known] = Rotation.from_quat(xyzw[:, order]).as_matrix()
        turns[f"the numbers of each quaternion taken as {said}"] = turned
    for words, turned in turns.items():
        yield words, "Correct the column map, or what wrote the file.", (body, positions, turned)
