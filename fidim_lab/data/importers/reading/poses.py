"""Rigid bodies of exports: rotations from quaternions or matrices, NaN where the body was not seen."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import permutations
from pathlib import Path

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from fidim_lab.arrays import Positions, Rotations
from fidim_lab.data.importers.recording import BodyTrack
from fidim_lab.errors import FileError

OFF = 0.02
"""by which a quaternion's norm, or a matrix's product with its transpose, may miss 1: exports round to 3 digits"""

VECTOR = "vector"
ANGLES = (VECTOR, *map("".join, permutations("XYZ")))
"""what three numbers of a rotation may mean"""


def by_quaternions(path: Path, name: str, positions: Positions, xyzw: Float[np.ndarray, "N 4"]) -> BodyTrack:
    """A body from places, m, and quaternions x, y, z, w. Raises FileError where one is not of unit length."""
    with np.errstate(over="ignore"):
        norm = np.linalg.norm(xyzw, axis=1)
    seen = np.isfinite(positions).all(axis=1) & np.isfinite(xyzw).all(axis=1) & (norm > 0.0)
    _refuse(path, name, seen & (np.abs(norm - 1.0) > OFF), "a quaternion whose length is not 1")
    rotations = np.full((len(xyzw), 3, 3), np.nan)
    if seen.any():
        rotations[seen] = Rotation.from_quat(xyzw[seen]).as_matrix()
    return BodyTrack(name, np.where(seen[:, None], positions, np.nan), rotations)


def by_quaternions_in(
    path: Path, name: str, positions: Positions, four: Float[np.ndarray, "N 4"]
) -> dict[str, BodyTrack]:
    """A body from places, m, and quaternions in both orders of their numbers: "wxyz" and "xyzw"."""
    ways = {"wxyz": [1, 2, 3, 0], "xyzw": [0, 1, 2, 3]}
    return {
        order: replace(by_quaternions(path, name, positions, four[:, at]), read_as=f"quaternions as {order}")
        for order, at in ways.items()
    }


def by_matrices(path: Path, name: str, positions: Positions, matrices: Rotations) -> BodyTrack:
    """A body from places, m, and rotation matrices body → world. Raises FileError where one is no rotation."""
    finite = np.isfinite(positions).all(axis=1) & np.isfinite(matrices).all(axis=(1, 2))
    seen = np.asarray(finite & (matrices != 0.0).any(axis=(1, 2)))
    known = np.where(seen[:, None, None], matrices, np.eye(3))
    with np.errstate(over="ignore", invalid="ignore"):
        product = known @ known.swapaxes(1, 2)
        near = np.abs(product - np.eye(3)).max(axis=(1, 2)) <= OFF
        wrong = np.asarray(~(near & (np.linalg.det(known) > 0.0)))
    _refuse(path, name, wrong, "a matrix that is not a rotation")
    turned = Rotation.from_matrix(known).as_matrix()
    rotations = np.where(seen[:, None, None], turned, np.nan)
    return BodyTrack(name, np.where(seen[:, None], positions, np.nan), rotations)


def by_angles(
    path: Path, name: str, positions: Positions, angles: Float[np.ndarray, "N 3"], orders: Sequence[str] = ANGLES
) -> tuple[BodyTrack, ...]:
    """A body from places, m, and three numbers for x, y, z, rad, whose meaning the file may not say: in every way.

    orders: of the body's own axes ("XYZ"), by default all six and VECTOR, a rotation vector. About fixed axes it is the
    reverse order.
    """
    seen = np.isfinite(positions).all(axis=1) & np.isfinite(angles).all(axis=1)
    found: list[BodyTrack] = []
    for said in orders:
        order = said.replace(VECTOR, "")
        rotations = np.full((len(angles), 3, 3), np.nan)
        if seen.any():
            sorted_ = angles[seen][:, ["XYZ".index(axis) for axis in order]] if order else angles[seen]
            turned = Rotation.from_euler(order, sorted_) if order else Rotation.from_rotvec(sorted_)
            rotations[seen] = turned.as_matrix()
        words = f"angles about its own {', '.join(order)} in turn" if order else "angles as a rotation vector"
        track = by_matrices(path, name, positions, rotations)
        found.append(replace(track, read_as=words))
    return tuple(found)


def _refuse(path: Path, name: str, wrong: np.ndarray, what: str) -> None:
    if wrong.any():
        raise FileError(path, f"body {name[:60]}, frame {int(np.argmax(wrong)) + 1}", what)
