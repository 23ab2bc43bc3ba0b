"""A new plan and a new campaign folder for a robot file, with places where that robot can really rest."""

from pathlib import Path

import numpy as np

from fidim_lab.app.starters.sections import Section, document
from fidim_lab.data.campaign import FORMAT as CAMPAIGN_FORMAT
from fidim_lab.data.campaign import INDEX, ROBOT, CampaignTable, WindowTable
from fidim_lab.data.files.input_file import read_text
from fidim_lab.data.plan_file import FORMAT as PLAN_FORMAT
from fidim_lab.data.plan_file import AccuracyTable, PlannedWindowTable, PlanTable, PoseTable
from fidim_lab.data.records import PlannedWindow, Robot
from fidim_lab.data.window_csv import WindowColumns, write_window_csv
from fidim_lab.identification.design.task import can_be_designed
from fidim_lab.identification.random_plan import WITHIN_LIMITS, random_plan

WINDOWS = (2, 1)
"""to identify from, and held out: enough to see the form"""
RATE, SECONDS = 100.0, 10.0
"""Hz and s of the example window"""
SEED = 1


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
        [Section("", CampaignTable, top), Section("[[window]]", WindowTable, window, says)],
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
