"""`fidim tension-calibrate`: gain, offset and friction band of each winch from a campaign, ready for the rig file."""

import math
from pathlib import Path

import numpy as np
from rich.table import Table

from fidim_lab.app.formats.answer_file import write_answer
from fidim_lab.app.terminal import console
from fidim_lab.data.campaign import ROBOT, read_campaign
from fidim_lab.data.robot_file import read_robot
from fidim_lab.identification.calibration.tension_calibration import (
    FEWEST,
    Rests,
    TensionReading,
    WinchCalibration,
    calibrate,
    rests_of,
    rests_of_readings,
)
from procedures.recording.journal import NAME as JOURNAL
from procedures.recording.journal import read_journal

FORMAT = "fidim-tension-calibration/1"


def tension_calibrate_command(campaign: Path, json_file: Path | None) -> int:
    """Print the calibration of every winch; exit 1 where one must not be used.

    Raises FileError for a campaign that cannot be read, RefusedError and InfeasibleError as `rests_of`.
    """
    rests, source = _rests(campaign)
    found = calibrate(rests)
    console.out.print(source, markup=False, highlight=False)
    console.out.print(_table(found))
    for number, winch in enumerate(found, start=1):
        console.out.print(_line(number, winch), markup=False, highlight=False)
    console.out.print(
        "The offset is in addition to that of the rig file used for the recording. Mass and geometry are those of the "
        "robot file; an error of 1 % in mass causes 1 % in gain.",
        markup=False,
    )
    write_answer(json_file, FORMAT, {"winches": found})
    return 1 if any(winch.problem for winch in found) else 0


def _rests(campaign: Path) -> tuple[Rests, str]:
    """Tension checks at rest from the folder's journal where there are enough, else the windows' means."""
    readings = _readings(campaign)
    if len(readings) >= FEWEST:
        robot = read_robot(campaign / ROBOT)
        against = "load cells" if all(r.load_cells is not None for r in readings) else "statics"
        return rests_of_readings(
            robot, robot.nominal, readings
        ), f"{len(readings)} tension checks, compared with {against}."
    read = read_campaign(campaign)
    return (
        rests_of(read.robot, read.robot.nominal, read.windows),
        f"{len(read.windows)} windows; the mean of a swing is not the rest tension, so the bands are wide. "
        "fidim run PLAN --procedure tension-check gives narrower ones.",
    )


def _readings(campaign: Path) -> list[TensionReading]:
    """Of every tension check that the journal has, in order."""
    journal = campaign / JOURNAL
    entries = read_journal(journal) if journal.is_file() else ()
    found = [entry.data["readings"] for entry in entries if entry.step == "CheckTension" and "readings" in entry.data]
    return [
        TensionReading(
            np.array(one["lengths"]),
            np.array(one["currents"]),
            np.array(one["moved"]),
            np.array(one["load_cells"]) if "load_cells" in one else None,
        )
        for one in found
    ]


def _table(found: tuple[WinchCalibration, ...]) -> Table:
    rows: list[tuple[str, ...]] = []
    for number, winch in enumerate(found, start=1):
        low, high = winch.range
        known = [f"{winch.gain:.2f}", f"{winch.sd_gain:.2f}", f"{winch.offset:+.2f}", f"{winch.sd_offset:.2f}"]
        middle = [*known, f"{winch.friction:.2f}"] if math.isfinite(winch.gain) else ["–"] * 5
        middle.append(f"{winch.scatter:.2f}" if math.isfinite(winch.scatter) else "–")
        rows.append((str(number), *middle, f"{low:.0f}–{high:.0f}", str(winch.rests)))
    measured = ("gain, N/A", "sd", "offset, N", "sd", "friction, ± N", "direction known, ± N")
    names = ("winch", *measured, "tensions, N", "rests")
    return console.table("Tension T = gain · I + offset, within ± friction", names, rows, left=0)


def _line(number: int, winch: WinchCalibration) -> str:
    """What goes into the rig file, or why nothing does."""
    if winch.problem:
        return f"winch {number}: not usable, {winch.problem}; record rest poses whose tensions differ more"
    values = f"gain = {winch.gain:.2f}, offset = {winch.offset:.2f}, friction = {winch.friction:.2f}"
    if math.isfinite(winch.scatter):
        load = f", load_friction = {winch.load_friction:.3f}" if winch.load_friction else ""
        values = (
            f"gain = {winch.gain:.2f}, offset = {winch.offset:.2f}, friction = {winch.directed:.2f}{load}, "
            f"scatter = {winch.scatter:.2f}"
        )
    return f"winch {number}: tension = {{ {values} }}"
