"""Plan files: the windows of an experiment, as TOML ("fidim-plan/1")."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import tomli_w
from pydantic import Field

from fidim_lab.data.files.toml_file import Name, Table, read_toml
from fidim_lab.data.records import Accuracy, Plan, PlannedWindow, Pose, Role
from fidim_lab.errors import FileError
from fidim_lab.units import HALL

FORMAT = "fidim-plan/1"
WINDOW_ID = re.compile(r"\w[\w.-]{0,79}")
"""it becomes the name of a file, which has 255 bytes at most with all that is added"""


class PoseTable(Table):
    """`pose` of a window: the origin of the robot file's body frame, and the rotation body → world."""

    position: tuple[float, float, float]
    rotation: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """rotation vector: axis times angle, rad"""


class PlannedWindowTable(Table):
    """`[[window]]`."""

    id: Name
    role: Role = Role.IDENTIFY
    lengths: list[Annotated[float, Field(gt=0)]]
    displacement: tuple[float, float]
    position: tuple[float, float, float]
    pose: PoseTable | None = None


class AccuracyTable(Table):
    """`accuracy = { s = …, I = … }`: largest standard deviations, m and m² per unit mass."""

    s: Annotated[float, Field(gt=0)]
    inertia: Annotated[float, Field(gt=0, alias="I")]


class PlanTable(Table):
    """The whole file."""

    format: Literal["fidim-plan/1"]
    name: str
    accuracy: AccuracyTable | None = None
    window: Annotated[list[PlannedWindowTable], Field(min_length=1)]


def wrong_id(ids: Sequence[str]) -> tuple[int, str] | None:
    """The first window, counted from 1, whose id cannot be a file's name or occurs twice, and why; None if none."""
    for number, id_ in enumerate(ids, start=1):
        if not WINDOW_ID.fullmatch(id_):
            return number, f"{id_[:100]!r} cannot be a file name; use letters, digits, _ . and -. At most 80."
        if id_ in ids[: number - 1]:
            return number, f"{id_!r} occurs twice"
    return None


def read_plan(path: Path, cables: int) -> Plan:
    """Read a plan for a robot of so many cables. Raises FileError naming every wrong key."""
    table = read_toml(path, PlanTable, FORMAT)
    for number, window in enumerate(table.window, start=1):
        if len(window.lengths) != cables:
            raise FileError(
                path, f"window {number}, lengths", f"{len(window.lengths)} values for a robot of {cables} cables"
            )
        for key in ("lengths", "displacement", "position"):
            largest = max(map(abs, getattr(window, key)))
            if largest > HALL:
                what = f"holds {largest:g}, which would be metres"
                raise FileError(path, f"window {number}, {key}", what, hint="Divide millimetres by 1000, everywhere.")
    wrong = wrong_id([window.id for window in table.window])
    if wrong is not None:
        number, problem = wrong
        raise FileError(path, f"window {number}, id", problem)
    return Plan(
        name=table.name,
        windows=tuple(
            PlannedWindow(
                w.id, w.role, np.array(w.lengths), np.array(w.displacement), np.array(w.position), _pose(w.pose)
            )
            for w in table.window
        ),
        accuracy=None if table.accuracy is None else Accuracy(table.accuracy.s, table.accuracy.inertia),
    )


def _pose(table: PoseTable | None) -> Pose | None:
    if table is None:
        return None
    from scipy.spatial.transform import Rotation  # a plan without poses does not wait for it: a robot may hang there

    return Pose(np.array(table.position), Rotation.from_rotvec(table.rotation).as_matrix())


def write_plan(path: Path, plan: Plan) -> None:
    """Write a plan that `read_plan` reads back."""
    table = {
        "format": FORMAT,
        "name": plan.name,
        **({} if plan.accuracy is None else {"accuracy": {"s": plan.accuracy.s, "I": plan.accuracy.inertia}}),
        "window": [
            {
                "id": w.id,
                "role": w.role.value,
                "lengths": [round(float(v), 5) for v in w.lengths],
                "displacement": [round(float(v), 5) for v in w.displacement],
                "position": [round(float(v), 5) for v in w.position],
                **_pose_as_table(w.pose),
            }
            for w in plan.windows
        ],
    }
    path.write_text(tomli_w.dumps(table), encoding="utf-8")


def _pose_as_table(pose: Pose | None) -> dict[str, object]:
    if pose is None:
        return {}
    from scipy.spatial.transform import Rotation

    rotation = Rotation.from_matrix(pose.rotation).as_rotvec()
    return {"pose": {"position": [float(v) for v in pose.position], "rotation": [float(v) for v in rotation]}}
