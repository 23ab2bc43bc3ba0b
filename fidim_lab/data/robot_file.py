"""Robot files, "fidim-robot/1": geometry, nominal body, limits, sensors, winches of one robot."""

from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Literal

import numpy as np
import tomli_w
from pydantic import Field, model_validator

from fidim_lab.data.files.toml_file import NotNegative, Positive, Table, read_toml
from fidim_lab.data.records import Body, Cable, Limits, Robot, Sensors, Survey, WinchTorque
from fidim_lab.errors import FileError

FORMAT = "fidim-robot/1"
PAPERS_ROBOT = Path(__file__).parent / "robots" / "irma4.toml"
"""the four-cable robot of the paper (Table 1, Eq. 43)"""
BUILT_IN_ROBOTS = MappingProxyType({"irma4": PAPERS_ROBOT})
"""robots that are called by name instead of a file"""

Vector = tuple[float, float, float]
Spread = tuple[NotNegative, NotNegative, NotNegative]

AXIS_TOLERANCE = 1e-6
"""how far x, y, z of a swivel may be from a right-handed orthonormal triad and be taken as they are"""
ROUNDED = 2e-3
"""how far they may be by rounding to three digits (1.7e-3 at most): then they are squared, by z and x"""

MOST_CABLES = 5
"""whose held lengths leave a free motion: 6 − n freedoms"""


class PlatformTable(Table):
    """`[platform]`."""

    mass: Positive
    nominal_com: Vector
    nominal_inertia: tuple[float, float, float, float, float, float]
    marker: Vector
    extra_markers: tuple[Vector, ...] = ()


class LimitsTable(Table):
    """`[limits]`."""

    tension: tuple[NotNegative, Positive] = (20.0, 200.0)
    free_displacement: tuple[Positive, Positive] = (0.1, 0.1)

    @model_validator(mode="after")
    def _ordered(self) -> "LimitsTable":
        if self.tension[0] >= self.tension[1]:
            raise ValueError(f"tension: the lower limit {self.tension[0]} N is not below the upper {self.tension[1]} N")
        return self


class SensorsTable(Table):
    """`[sensors]`."""

    marker_noise: Positive = 1e-4
    encoder_resolution: Positive = 2e-5
    gyro_noise: Positive = 3e-3


class WinchTable(Table):
    """`[winch]` for all cables, or `[[winch]]` for each."""

    drum_radius: Positive
    gear_ratio: Positive
    efficiency: Annotated[float, Field(gt=0, le=1)]
    torque_constant: Positive


class SurveyTable(Table):
    """`[survey]`: standard deviations of the geometry, 0 where it is exact (a simulation)."""

    anchor: NotNegative = 0.0
    attachment: NotNegative = 0.0
    radius: NotNegative = 0.0
    axis: NotNegative = 0.0
    marker: NotNegative = 0.0
    encoder_zero: NotNegative = 0.0
    frame_shift: NotNegative = 0.0
    frame_rotation: NotNegative = 0.0
    gravity: NotNegative = 0.0


def _squared(x: np.ndarray, z: np.ndarray) -> dict[str, list[float]]:
    """The axes by z and x alone; nothing where x is along z."""
    length = np.linalg.norm(z)
    upright = z / length if length > 0 else z
    across = x - (x @ upright) * upright
    if np.linalg.norm(across) <= AXIS_TOLERANCE:
        return {}
    level = across / np.linalg.norm(across)
    axes = {"x": level, "y": np.cross(upright, level), "z": upright}
    return {name: (axis + 0.0).tolist() for name, axis in axes.items()}


def _to_be_written(axes: dict[str, list[float]]) -> str:
    """In place of what stands in the file."""
    written = (f"{name} = [{', '.join(f'{value:.7g}' for value in axis)}]" for name, axis in axes.items())
    return f"; by z and x: {', '.join(written)}" if axes else ": y = z × x"


class CableTable(Table):
    """`[[cable]]`."""

    name: str = ""
    d: Vector
    a: Vector
    radius: NotNegative
    x: Vector
    y: Vector
    z: Vector
    survey_d: Spread | None = None
    survey_a: Spread | None = None

    @model_validator(mode="after")
    def _triad(self) -> "CableTable":
        axes = np.array([self.x, self.y, self.z])
        off = np.abs(axes @ axes.T - np.eye(3)).max()
        by_two = _squared(axes[0], axes[2])
        if off > ROUNDED or not by_two:
            raise ValueError(f"x, y, z are not unit vectors at right angles{_to_be_written(by_two)}")
        turned = np.abs(np.cross(self.x, self.y) - self.z).max()
        if turned > ROUNDED:
            raise ValueError("x × y is not z: the swivel's axes must be right-handed")
        if max(off, turned) > AXIS_TOLERANCE:
            return self.model_copy(update={name: tuple(axis) for name, axis in by_two.items()})
        return self


class RobotTable(Table):
    """The whole file."""

    format: Literal["fidim-robot/1"]
    gravity: Vector = (0.0, 0.0, -9.81)
    platform: PlatformTable
    limits: LimitsTable = LimitsTable()
    sensors: SensorsTable = SensorsTable()
    winch: WinchTable | list[WinchTable] | None = None
    survey: SurveyTable | None = None
    cable: Annotated[list[CableTable], Field(min_length=1)]

    @model_validator(mode="after")
    def _consistent(self) -> "RobotTable":
        if len(self.cable) > MOST_CABLES:
            raise ValueError(
                f"cable: {len(self.cable)} tables; {len(self.cable)} cables of held length leave the platform no "
                f"freedom (6 - n), so nothing swings and free motion does not show the body; 1 to {MOST_CABLES} can"
            )
        names = [cable.name for cable in self.cable if cable.name]
        if len(set(names)) < len(names):
            raise ValueError(f"cable, name: {', '.join(names)}; each cable needs a name of its own")
        if isinstance(self.winch, list) and len(self.winch) != len(self.cable):
            raise ValueError(f"winch: {len(self.winch)} tables for {len(self.cable)} cables; give one for all, or each")
        if not any(self.gravity):
            raise ValueError("gravity: is zero; a free motion about an equilibrium needs it")
        return self


def robot_path(named: str, folder: Path = Path()) -> Path:
    """The file of a robot that a person has named: a built-in one, or a path that counts from `folder`."""
    return BUILT_IN_ROBOTS.get(named, folder / named)


def read_robot(path: Path, *, named_by: Path | None = None) -> Robot:
    """Read and check a robot file. Raises FileError naming every wrong key.

    named_by: the campaign or rig file whose key `robot` names this one, for the message.
    """
    try:
        return _robot(read_toml(path, RobotTable, FORMAT))
    except FileError as error:
        raise (error if named_by is None else error.named_by(named_by, "robot")) from None


def write_robot(path: Path, robot: Robot, *, comment: str = "") -> None:
    """Write a robot file that `read_robot` reads back to the same values."""
    header = "".join(f"# {line}\n" for line in comment.splitlines())
    path.write_text(header + tomli_w.dumps(_table(robot)), encoding="utf-8")


def _robot(table: RobotTable) -> Robot:
    platform = table.platform
    winches = table.winch
    if isinstance(winches, WinchTable):
        winches = [winches] * len(table.cable)
    return Robot(
        cables=tuple(
            Cable(np.array(c.d), np.array(c.a), c.radius, np.array(c.x), np.array(c.y), np.array(c.z), c.name)
            for c in table.cable
        ),
        mass=platform.mass,
        nominal=Body(np.array(platform.nominal_com), np.array(platform.nominal_inertia)),
        marker=np.array(platform.marker),
        extra_markers=tuple(np.array(m) for m in platform.extra_markers),
        gravity=np.array(table.gravity),
        limits=Limits(table.limits.tension, table.limits.free_displacement),
        sensors=Sensors(**table.sensors.model_dump()),
        winches=None if winches is None else tuple(WinchTorque(**w.model_dump()) for w in winches),
        survey=_survey(table),
    )


def _survey(table: RobotTable) -> Survey | None:
    """A cable's own standard deviations count before those of all; None where nothing is said of any."""
    own = any(c.survey_d is not None or c.survey_a is not None for c in table.cable)
    if table.survey is None and not own:
        return None
    common = SurveyTable() if table.survey is None else table.survey
    scalars = common.model_dump(exclude={"anchor", "attachment"})
    return Survey(
        anchor=np.array([c.survey_d or 3 * (common.anchor,) for c in table.cable]),
        attachment=np.array([c.survey_a or 3 * (common.attachment,) for c in table.cable]),
        **scalars,
    )


def _table(robot: Robot) -> dict[str, object]:
    platform: dict[str, object] = {
        "mass": robot.mass,
        "nominal_com": _floats(robot.nominal.com),
        "nominal_inertia": _floats(robot.nominal.inertia),
        "marker": _floats(robot.marker),
    }
    if robot.extra_markers:
        platform["extra_markers"] = [_floats(m) for m in robot.extra_markers]
    table: dict[str, object] = {
        "format": FORMAT,
        "gravity": _floats(robot.gravity),
        "platform": platform,
        "limits": {
            "tension": list(robot.limits.tension),
            "free_displacement": list(robot.limits.free_displacement),
        },
        "sensors": {
            "marker_noise": robot.sensors.marker_noise,
            "encoder_resolution": robot.sensors.encoder_resolution,
            **({} if robot.sensors.gyro_noise == Sensors.gyro_noise else {"gyro_noise": robot.sensors.gyro_noise}),
        },
    }
    if robot.winches is not None:
        alike = len(set(robot.winches)) == 1
        tables = [dict(vars(w)) for w in robot.winches]
        table["winch"] = tables[0] if alike else tables
    if robot.survey is not None:
        table["survey"] = robot.survey.scalars
    table["cable"] = [
        ({"name": c.name} if c.name else {})
        | {
            "d": _floats(c.d),
            "a": _floats(c.a),
            "radius": c.radius,
            "x": _floats(c.x),
            "y": _floats(c.y),
            "z": _floats(c.z),
        }
        | _own_survey(robot.survey, k)
        for k, c in enumerate(robot.cables)
    ]
    return table


def _own_survey(survey: Survey | None, cable: int) -> dict[str, list[float]]:
    if survey is None:
        return {}
    return {"survey_d": _floats(survey.anchor[cable]), "survey_a": _floats(survey.attachment[cable])}


def _floats(values: np.ndarray) -> list[float]:
    return [float(v) for v in values]
