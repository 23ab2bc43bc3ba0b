"""A new robot file: a plausible robot of so many cables, whose numbers are replaced by those of the real one."""

from pathlib import Path

import numpy as np

from fidim_lab.app.starters.sections import Section, document
from fidim_lab.data.robot_file import (
    FORMAT,
    CableTable,
    LimitsTable,
    PlatformTable,
    RobotTable,
    SensorsTable,
    SurveyTable,
    WinchTable,
)

ANCHORS, HEIGHT = 1.2, 2.4
"""m: radius of the circle of anchors, and their height above the floor"""
SKEW = 0.45
"""rad by which attachments turn against their anchors, to and fro: cables that meet in one line leave a freedom"""


def robot_text(path: Path, cables: int) -> str:
    """The file as text; `path` is how the commands in it call it."""
    opening = f"""A robot of {cables} cables: replace every number by yours. docs/own-robot.md has a drawing.
World frame: fixed to the room, the frame of the motion capture, z up. Body frame: fixed to the platform, origin P.
A line with # before a key shows the default of that key. When done:
    fidim doctor --robot {path}        # finds mistakes, draws the robot
    fidim dry-run --robot {path}       # the whole experiment on simulators"""
    return document("robot", opening, _sections(cables))


def _sections(cables: int) -> list[Section]:
    platform = {
        "mass": 8.0,
        "nominal_com": [0.0, 0.0, 0.05],
        "nominal_inertia": [0.03, 0.034, 0.04, 0.0, 0.0, 0.0],
        "marker": [0.02, 0.01, 0.0],
        "extra_markers": [[0.2, 0.0, 0.02], [-0.1, 0.17, 0.02], [-0.1, -0.15, 0.1]],
    }
    winch = {"drum_radius": 0.03, "gear_ratio": 10.0, "efficiency": 0.85, "torque_constant": 0.12}
    return [
        Section("", RobotTable, {"format": FORMAT, "gravity": [0.0, 0.0, -9.81]}),
        Section("[platform]", PlatformTable, platform),
        Section("[limits]", LimitsTable, {"tension": [5.0, 200.0], "free_displacement": [0.1, 0.1]}),
        Section("[sensors]", SensorsTable, {"marker_noise": 1e-4, "encoder_resolution": 2e-5}),
        Section("[winch]", WinchTable, winch, says="One table [winch] for all winches, or one [[winch]] for each."),
        Section(
            "[survey]",
            SurveyTable,
            says="How well the geometry is known. Without this table an exact and a usual survey are both fitted, and "
            "the recordings decide. Remove the # before the table and before what you know.",
            commented=True,
        ),
        *(_cable(number, cables) for number in range(cables)),
    ]


def _cable(number: int, cables: int) -> Section:
    says = "One table for each cable, in the order of the winches." if number == 0 else ""
    own = {"name": f"cable {number + 1}"}
    return Section("[[cable]]", CableTable, cable_values(number, cables), says, silent=number > 0, examples=own)


def cable_values(number: int, cables: int) -> dict[str, object]:
    """Cable `number` (from 0) of a plausible robot: winches on the floor, pulleys on a ring that swivel upright."""
    turn = 2 * np.pi * number / cables + 0.3
    wide, inner = (ANCHORS, 0.22) if cables > 2 else (0.8, 0.3)
    skew = SKEW * (-1) ** number + 0.1 * number if cables > 3 else 0.03 * number
    out = np.array([np.cos(turn), np.sin(turn), 0.0])
    anchor = wide * out + np.array([0.0, 0.0, HEIGHT + 0.03 * number])
    held = np.array([inner * np.cos(turn + skew), inner * np.sin(turn + skew), 0.15 + 0.02 * number])
    return {
        "d": np.round(anchor, 3).tolist(),
        "a": np.round(held, 3).tolist(),
        "radius": 0.025,
        "x": _unit(-out),
        "y": _unit(np.cross([0.0, 0.0, 1.0], -out)),
        "z": [0, 0, 1],
    }


def _unit(direction: np.ndarray) -> list[float]:
    """To as many digits as the reader wants of unit vectors."""
    return np.round(direction, 9).tolist()
