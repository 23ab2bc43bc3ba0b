"""`fidim init`: a new file of a kind, where nothing is yet."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fidim_lab.app.formats.answer_file import write_answer
from fidim_lab.app.starters.rig import RigWish, rig_text
from fidim_lab.app.starters.sections import Section, document
from fidim_lab.app.terminal import console
from fidim_lab.data.campaign import FORMAT as CAMPAIGN_FORMAT
from fidim_lab.data.campaign import INDEX, ROBOT, CampaignTable, WindowTable
from fidim_lab.data.files.input_file import read_text
from fidim_lab.data.period_table import PeriodTable
from fidim_lab.data.plan_file import FORMAT as PLAN_FORMAT
from fidim_lab.data.plan_file import AccuracyTable, PlannedWindowTable, PlanTable, PoseTable
from fidim_lab.data.records import PlannedWindow, Robot
from fidim_lab.data.robot_file import FORMAT as ROBOT_FORMAT
from fidim_lab.data.robot_file import (
    CableTable,
    LimitsTable,
    PlatformTable,
    RobotTable,
    SensorsTable,
    SurveyTable,
    WinchTable,
    read_robot,
)
from fidim_lab.data.window_csv import WindowColumns, write_window_csv
from fidim_lab.errors import SetupError
from fidim_lab.identification.design.task import can_be_designed
from fidim_lab.identification.random_plan import WITHIN_LIMITS, random_plan

WINDOWS = (2, 1)
"""to identify from, and held out: enough to see the form"""
RATE, SECONDS = 100.0, 10.0
"""Hz and s of the example window"""
TIMED = "One table for each time by a stopwatch or a light gate, in place of windows; fidim import periods writes them."
SEED = 1


ANCHORS, HEIGHT = 1.2, 2.4
"""m: radius of the circle of anchors, and their height above the floor"""
SKEW = 0.45
"""rad by which attachments turn against their anchors, to and fro: cables that meet in one line leave a freedom"""

FORMAT = "fidim-init/1"
ROBOT_FILE = Path("robot.toml")


@dataclass(frozen=True)
class InitOptions:
    """As on the command line."""

    kind: str
    """robot, rig, plan or campaign"""
    out: Path | None
    robot: Path | None
    cables: int
    simulated: bool
    json_file: Path | None


def init_command(options: InitOptions) -> int:
    """Write the file and say what to do next; returns 0.

    Raises SetupError where something is there already, FileError for a wrong robot file, InfeasibleError where that
    robot rests nowhere within its limits.
    """
    kind = options.kind
    path = options.out or Path("campaign" if kind == "campaign" else f"{kind}.toml")
    taken = path.exists() and not (kind == "campaign" and path.is_dir() and not any(path.iterdir()))
    if taken:
        raise SetupError(f"{path} exists already; nothing in it was touched.", hint="Choose another --out.")
    if kind == "robot":
        _check_cables(options.cables)
        text, further = robot_text(path, options.cables), f"fidim doctor --robot {path}"
    else:
        text, further = _for_robot(options, path)
    if text:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    console.out.print(f"written     {path}", markup=False)
    console.out.print("            replace its numbers by yours; every key is explained in it", markup=False)
    console.out.print(f"next        {further}", markup=False)
    write_answer(options.json_file, FORMAT, {"kind": kind, "path": str(path), "next": further})
    return 0


def _check_cables(cables: int) -> None:
    """Raises SetupError for robots of which there is no pattern, with the reason."""
    if cables > 5:
        raise SetupError(
            f"--cables {cables}: with six cables or more and held motors a platform cannot swing. Allowed: 2 to 5."
        )
    if cables < 2:
        what = f"--cables {cables}: allowed are 2 to 5."
        raise SetupError(what, hint="A body on one cord: examples/robots and docs/pendulums.md.")


def _for_robot(options: InitOptions, path: Path) -> tuple[str, str]:
    """The text of a file that belongs to a robot, and what to type next; a campaign is written here."""
    robot_file = options.robot or ROBOT_FILE
    if options.robot is None and not ROBOT_FILE.exists():
        hint = "fidim init robot writes one; or name yours with --robot."
        raise SetupError(f"A {options.kind} is for a robot, and there is no {ROBOT_FILE} here.", hint=hint)
    robot = read_robot(robot_file)
    if options.kind == "rig":
        wish = RigWish(path, robot_file, robot, options.simulated)
        return rig_text(wish), f"fidim simulators {path}" if options.simulated else f"fidim doctor --rig {path}"
    if options.kind == "plan":
        return plan_text(path, robot_file, robot), f"fidim dry-run --robot {robot_file} --plan {path}"
    write_campaign_folder(path, robot_file, robot)
    return "", f"fidim identify {path}"


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
        Section("", RobotTable, {"format": ROBOT_FORMAT, "gravity": [0.0, 0.0, -9.81]}),
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


def plan_text(path: Path, robot_file: Path, robot: Robot) -> str:
    """A plan as text. Raises InfeasibleError where the robot rests nowhere within its limits."""
    further = f"""This one shows the form; with the twelve most informative places:
    fidim design --robot {robot_file} --out design"""
    if not can_be_designed(robot):  # three free motions or more: nobody displaces a marker in so many coordinates
        further = f"""This one shows the form; with twelve places at random, as rehearsal/plan.toml:
    fidim dry-run --robot {robot_file} --out rehearsal"""
    opening = f"""A plan for {robot_file}: where the platform hangs, and how it is displaced, window by window.
{further}
To rehearse it, and to run it:
    fidim dry-run --robot {robot_file} --plan {path}
    fidim run {path} --rig RIG.toml"""
    sections = [
        Section("", PlanTable, {"format": PLAN_FORMAT, "name": path.stem}),
        Section("[accuracy]", AccuracyTable, says="With this table a run ends early.", commented=True),
    ]
    for number, window in enumerate(random_plan(robot, "", *WINDOWS, SEED, WITHIN_LIMITS).windows):
        sections += _planned(window, first=number == 0)
    return document("plan", opening, sections)


def _planned(window: PlannedWindow, *, first: bool) -> list[Section]:
    values = {
        "id": window.id,
        "role": window.role.value,
        "lengths": [round(float(v), 4) for v in window.lengths],
        "displacement": [round(float(v), 4) for v in window.displacement],
        "position": [round(float(v), 4) for v in window.position],
    }
    says = "One table for each window, in the order in which they are recorded." if first else ""
    sections = [Section("[[window]]", PlannedWindowTable, values, says, silent=not first)]
    if first:
        pose = "The whole pose at rest, where lengths alone do not determine it."
        sections.append(Section("[window.pose]", PoseTable, says=pose, commented=True))
    return sections


def write_campaign_folder(folder: Path, robot_file: Path, robot: Robot) -> None:
    """A campaign with one window that is to be replaced: the platform at rest. `folder` is empty.

    Raises InfeasibleError where the robot rests nowhere within its limits, OSError where nothing can be written.
    """
    planned = random_plan(robot, "", 1, 0, SEED, WITHIN_LIMITS).windows[0]
    opening = f"""Recordings of the robot in {ROBOT}, a copy of {robot_file.name}. 
fidim import makes such a folder of other programs' files by itself: docs/import.md.
Replace windows/i01.csv (the platform at rest, to show the form) by your windows of free motion; list each. Then:
    fidim identify {folder}"""
    top = {"format": CAMPAIGN_FORMAT, "name": folder.resolve().name, "robot": ROBOT, "sample_rate": RATE}
    place = [round(float(v), 4) for v in planned.position]
    window = {"id": "i01", "file": "windows/i01.csv", "role": "identify", "equilibrium": place}
    says = "One table for each window."
    index = document(
        "campaign",
        opening,
        [
            Section("", CampaignTable, top),
            Section("[[window]]", WindowTable, window, says),
            Section("[[period]]", PeriodTable, says=TIMED, commented=True),
        ],
    )
    (folder / "windows").mkdir(parents=True, exist_ok=True)
    (folder / ROBOT).write_text(read_text(robot_file), encoding="utf-8")
    write_window_csv(folder / window_file(), _at_rest(robot, planned))
    (folder / INDEX).write_text(index, encoding="utf-8")


def window_file() -> str:
    """Of the example."""
    return "windows/i01.csv"


def _at_rest(robot: Robot, planned: PlannedWindow) -> WindowColumns:
    count = int(RATE * SECONDS) + 1
    markers = np.broadcast_to(planned.position, (count, 1, 3))
    return WindowColumns(np.arange(count) / RATE, markers.copy(), np.tile(planned.lengths, (count, 1)), None, {})
