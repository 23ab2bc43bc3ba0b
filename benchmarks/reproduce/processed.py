"""What the GRAB laboratory made of its own takes: filtered poses, and the bodies that it identified.

    processed/NN_exp_K.mat        p, v, a (6 × samples): place of P in m, intrinsic x-y-z angles in rad, and their
                                  derivatives by time, at 100 Hz; NN 44, 33, 22 by the number of cables; K counts from 1
                                  within these
    identification/par_N.mat      χ by N = 2, 3, 4 cables (10 numbers, the first is 1)
    identification/res_opt.mat    χ of Eq. 47 in full digits (X_opt), σ% (sigma_perc_opt), C (val_opt)

Every mistake is a FileError with file and variable.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from fidim_lab.data.importers.grab import GROUPS
from fidim_lab.data.importers.reading.matlab import load_array, variables
from fidim_lab.data.records import Body, Motion
from fidim_lab.errors import FileError

RATE = 100.0
"""Hz"""


@dataclass(frozen=True, eq=False)
class Processed:
    """One take as the laboratory filtered it."""

    number: int
    """of the take, as in the names of the Vicon files"""
    cables: int
    motion: Motion
    rates: Float[np.ndarray, "N 3"]
    """derivatives of P's place as they stand in the file, m/s"""
    accelerations: Float[np.ndarray, "N 3"]


def read_processed(folder: Path, number: int) -> Processed | None:
    """A take's filtered poses; None where the folder has none of it."""
    for group in GROUPS:
        if number in group.takes:
            within = number - group.takes[0] + 1
            path = folder / "processed" / f"{group.cables}{group.cables}_exp_{within}.mat"
            return _processed(path, number, group.cables) if path.exists() else None
    return None


def _processed(path: Path, number: int, cables: int) -> Processed:
    p, v, a = (load_array(path, name, 6, None).T for name in ("p", "v", "a"))
    if not len(p) == len(v) == len(a) or len(p) < 2:
        raise FileError(path, "p, v, a", f"have {len(p)}, {len(v)} and {len(a)} samples; as many of each are needed")
    return Processed(number, cables, motion_of(p, v, a), v[:, :3], a[:, :3])


def motion_of(p: Float[np.ndarray, "N 6"], v: Float[np.ndarray, "N 6"], a: Float[np.ndarray, "N 6"]) -> Motion:
    """Poses, twists and accelerations of places and intrinsic x-y-z angles: R = R_x R_y R_z."""
    about_x, about_y, about_z = (_turns(p[:, 3 + axis], axis) for axis in range(3))
    first = np.broadcast_to(np.eye(3)[0], (len(p), 3))
    second, third = about_x[:, :, 1], (about_x @ about_y)[:, :, 2]
    dx, dy, dz = (v[:, 3 + k, np.newaxis] for k in range(3))
    carried = first * dx
    both = carried + second * dy
    spins = both + third * dz
    turned = np.cross(carried, second) * dy + np.cross(both, third) * dz
    rates = first * a[:, 3, np.newaxis] + second * a[:, 4, np.newaxis] + third * a[:, 5, np.newaxis] + turned
    return Motion(
        np.arange(len(p)) / RATE,
        p[:, :3],
        about_x @ about_y @ about_z,
        np.hstack([v[:, :3], spins]),
        np.hstack([a[:, :3], rates]),
    )


def _turns(angles: Float[np.ndarray, " N"], axis: int) -> Float[np.ndarray, "N 3 3"]:
    """Rotations about one of x, y, z."""
    j, k = (axis + 1) % 3, (axis + 2) % 3
    found = np.zeros((len(angles), 3, 3))
    found[:, axis, axis] = 1.0
    found[:, j, j] = found[:, k, k] = np.cos(angles)
    found[:, k, j] = np.sin(angles)
    found[:, j, k] = -found[:, k, j]
    return found


def read_bodies(folder: Path) -> Mapping[int, Body]:
    """The laboratory's bodies, by the number of cables; those whose file is there."""
    found: dict[int, Body] = {}
    for cables in (4, 3, 2):
        path = folder / "identification" / f"par_{cables}.mat"
        if path.exists():
            names = variables(path)
            if len(names) != 1:
                raise FileError(path, ", ".join(names)[:100], "one variable of ten numbers was expected")
            found[cables] = Body.from_vector(load_array(path, names[0], 10)[1:])
    return found
