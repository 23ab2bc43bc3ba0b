"""The folder of the FIDIM paper's takes (GRAB laboratory): Vicon texts, robot logs, geometry of 4, 3 and 2 cables.

    vicon/v_nat_f_K.txt                     markers `platform:platform1…5`, marker 1 is P
    logs/r_nat_f_K.log                      3, t, actuator, state, counts, speed, torque, length, swivel in
                                            counts, quadrant, swivel in rad
    config/Grab_prototype_{44,33,22}.json   anchors, swivel axes, attachments, gravity's axis, nominal body
    markers/marker_pos_rel_to_ref.mat       markers 2–5 from marker 1, platform frame, mm

How many cables a take had is told by its number, as the folder's README says; a log's actuators are held against it.
The three-cable configuration lists its second actuator in another place than the logs do, so cables are matched in
the order in which they stand. Every mistake is a FileError with file and place.
"""

import re
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from fidim_lab.data.files.input_file import read_bytes, read_json
from fidim_lab.data.importers.reading.matlab import load_structs
from fidim_lab.data.importers.takes import EncoderLog, Take, Takes
from fidim_lab.data.importers.vicon_text import read_trajectories
from fidim_lab.data.records import Body, Cable, Robot, Role
from fidim_lab.errors import FidimError, FileError, SetupError

KIND = "grab"
GRAVITY = 9.80665
"""m/s², along the configuration's axis"""
FITTED = frozenset((8, 9, 12, 13, 18, 19, 20, 21, 22, 23, 26, 31, 32, 33, 36))
"""four-cable takes from which the paper identified"""
VALIDATED = frozenset((31, 20, 12, 1, 6, 10, 27, 28, 24, 15, 7, 16, 29, 5, 11, 35, 2, 30, 34, 4, 25, 3))
"""four-cable takes of its Fig. 3"""
LOG_COLUMNS = 11
TIME, ACTUATOR, LENGTH, SWIVEL = 1, 2, 7, 10
"""columns of a log"""
FEWEST_ROWS = 100


@dataclass(frozen=True)
class Group:
    """Takes with the same cables."""

    cables: int
    config: str
    takes: range
    """their numbers"""


GROUPS = (
    Group(4, "Grab_prototype_44.json", range(1, 37)),
    Group(3, "Grab_prototype_33.json", range(37, 49)),
    Group(2, "Grab_prototype_22.json", range(49, 61)),
)

UNGROUPED = f"no configuration is known for it: takes are 1 to {GROUPS[-1].takes[-1]}"


def read_grab(folder: Path, wanted: Callable[[int], bool] = lambda _: True) -> tuple[Takes, ...]:
    """Read the takes whose number is wanted, grouped by how many cables held the platform.

    A take whose files are spoilt is named in `unread`. Raises SetupError where there is no such take, FileError where
    geometry or markers are wrong.
    """
    found = {int(m.group(1)): path for path in _files(folder / "vicon") if (m := re.search(r"(\d+)\.txt$", path.name))}
    numbers = sorted(number for number in found if wanted(number))
    if not numbers:
        raise SetupError(f"{folder / 'vicon'} holds no wanted take.", hint="Takes are named by number: --takes 1-36.")
    markers = _markers(folder / "markers" / "marker_pos_rel_to_ref.mat")
    groups = ((group, [number for number in numbers if number in group.takes]) for group in GROUPS)
    read = [_group(folder, group, chosen, found, markers) for group, chosen in groups if chosen]
    strays = {f"k{n:02d}": UNGROUPED for n in numbers if not any(n in group.takes for group in GROUPS)}
    if not read:
        raise SetupError(f"Takes {', '.join(strays)}: {UNGROUPED}.", hint="Takes are named by number: --takes 1-36.")
    return (replace(read[0], unread={**read[0].unread, **strays}), *read[1:])


def _files(folder: Path) -> Sequence[Path]:
    if not folder.is_dir():
        raise FileError(folder, "", "no such folder; a folder with vicon, logs, config and markers was expected")
    return sorted(folder.iterdir())


def _group(folder: Path, group: Group, numbers: Sequence[int], found: dict[int, Path], markers: np.ndarray) -> Takes:
    config = folder / "config" / group.config
    robot = read_config(config, markers)
    if robot.n != group.cables:
        raise FileError(config, "actuator", f"{robot.n} are active; {group.cables} were expected")
    takes: list[Take] = []
    unread: dict[str, str] = {}
    for number in numbers:
        log = folder / "logs" / f"r_nat_f_{number}.log"
        try:
            logged = read_log(log, group.cables) if log.exists() else None
            takes.append(Take(f"k{number:02d}", read_trajectories(found[number]), logged, role_of(number)))
        except FidimError as error:
            unread[f"k{number:02d}"] = str(error)
    return Takes(KIND, f"grab-{group.cables}", robot, config, tuple(takes), unread)


def role_of(number: int) -> Role | None:
    """The paper's own use of a take of four cables: what it fitted, what it validated on, what it never showed (test).

    It says nothing of those with three and two.
    """
    if number in FITTED:
        return Role.IDENTIFY
    if number not in GROUPS[0].takes:
        return None
    return Role.VALIDATE if number in VALIDATED else Role.TEST


def _markers(path: Path) -> np.ndarray:
    """(5, 3) m, body frame: marker 1 is P itself."""
    others = [marker.array("p", 3) for marker in load_structs(path, "marker_rec")]
    return np.vstack([np.zeros(3), 1e-3 * np.array(others)])


def read_config(path: Path, markers: np.ndarray) -> Robot:
    """The robot of one configuration. Raises FileError naming the key."""
    table = read_json(path)
    platform = _get(path, table, "platform")
    active = [a for a in _get(path, table, "actuator") if isinstance(a, dict) and a.get("active") is True]
    com = _numbers(path, platform, "pos_PG_loc", 3)
    about_com = _numbers(path, platform, "inertia_mat_G_loc", 9).reshape(3, 3)
    mass = float(_numbers(path, platform, "mass", 1)[0])
    axis = _numbers(path, platform, "gravity_axis", 3)
    if mass <= 0.0 or not np.isclose(np.linalg.norm(axis), 1.0, atol=1e-3):
        raise FileError(path, "platform", "mass must be positive and gravity_axis a unit vector")
    return Robot(
        cables=tuple(_cable(path, actuator) for actuator in active),
        mass=mass,
        nominal=Body.from_about_com(com, about_com / mass),
        marker=markers[0],
        extra_markers=tuple(markers[1:]),
        gravity=-GRAVITY * axis / np.linalg.norm(axis),
    )


def _cable(path: Path, actuator: dict[str, Any]) -> Cable:
    pulley, winch = _get(path, actuator, "pulley"), _get(path, actuator, "winch")
    axes = np.array([_numbers(path, pulley, f"vers_{name}", 3) for name in "ijk"])
    if np.abs(np.linalg.svd(axes, compute_uv=False) - 1.0).max() > 0.05 or np.linalg.det(axes) < 0.0:
        raise FileError(path, "actuator, pulley", "vers_i, vers_j, vers_k are not right-handed unit vectors")
    z = axes[2] / np.linalg.norm(axes[2])  # the swivel's axis stays; x and y are made perpendicular to it
    x = axes[0] - (axes[0] @ z) * z
    x = x / np.linalg.norm(x)
    return Cable(
        d=_numbers(path, pulley, "pos_OD_glob", 3),
        a=_numbers(path, winch, "pos_PA_loc", 3),
        radius=float(_numbers(path, pulley, "radius", 1)[0]),
        x=x,
        y=np.cross(z, x),
        z=z,
    )


def _get(path: Path, table: Any, key: str) -> Any:
    if not isinstance(table, dict) or key not in table:
        raise FileError(path, key, "is missing")
    return table[key]


def _numbers(path: Path, table: Any, key: str, size: int) -> np.ndarray:
    try:
        values = np.array(_get(path, table, key), dtype=float).ravel()
    except (ValueError, TypeError):
        values = np.zeros(0)
    if len(values) != size or not np.isfinite(values).all():
        raise FileError(path, key, f"is not {size} numbers")
    return values


def read_log(path: Path, cables: int) -> EncoderLog:
    """A controller's log: one row an actuator, cyclic; padded with NUL bytes. Raises FileError with the line."""
    lines = read_bytes(path).replace(b"\0", b"").decode("ascii", "replace").splitlines()
    rows: list[list[float]] = []
    for number, line in enumerate(lines, start=1):
        if line.strip():
            rows.append(_log_row(path, number, line))
    if len(rows) < FEWEST_ROWS:
        raise FileError(path, "", f"{len(rows)} rows; a log has at least {FEWEST_ROWS}")
    table = np.array(rows)
    actuators = sorted(set(table[:, ACTUATOR]))
    if len(actuators) != cables:
        named = ", ".join(f"{a:g}" for a in actuators)
        raise FileError(path, "column 3", f"actuators {named}; the take has {cables} cables")
    return _cyclic(path, table, actuators)


def _log_row(path: Path, number: int, line: str) -> list[float]:
    try:
        row = [float(cell) for cell in line.split(",")]
    except ValueError:
        row = []
    if len(row) != LOG_COLUMNS or not np.isfinite(row).all():
        raise FileError(path, f"line {number}", f"is not {LOG_COLUMNS} numbers: is the log cut off?")
    return row


def _cyclic(path: Path, table: np.ndarray, actuators: Collection[float]) -> EncoderLog:
    """One sample for each time that all actuators have; times are printed to 0.01 s and may repeat or skip."""
    parts = [table[table[:, ACTUATOR] == actuator] for actuator in actuators]
    t = np.unique(parts[0][:, TIME])
    for part in parts[1:]:
        t = np.intersect1d(t, part[:, TIME])
    if len(t) < FEWEST_ROWS // 2:
        raise FileError(path, "column 2", f"{len(t)} times are common to all actuators")
    picked = [part[np.searchsorted(part[:, TIME], t)] for part in parts if (np.diff(part[:, TIME]) >= 0.0).all()]
    if len(picked) < len(parts):
        raise FileError(path, "column 2", "time goes back")
    return EncoderLog(
        path,
        t,
        np.column_stack([part[:, LENGTH] for part in picked]),
        np.column_stack([part[:, SWIVEL] for part in picked]),
    )
