"""`fidim tension-calibrate`: gain, offset and friction band of each winch from a campaign, ready for the rig file."""

import json
import math
from dataclasses import asdict
from pathlib import Path

from rich.table import Table

from fidim_lab.app import console
from fidim_lab.data.campaign import read_campaign
from fidim_lab.identification.tension_calibration import WinchCalibration, calibrate, rests_of

FORMAT = "fidim-tension-calibration/1"


def tension_calibrate_command(campaign: Path, json_file: Path | None) -> int:
    """Print the calibration of every winch; exit 1 where one must not be used.

    Raises FileError for a campaign that cannot be read, RefusedError and InfeasibleError as `rests_of`.
    """
    read = read_campaign(campaign)
    found = calibrate(rests_of(read.robot, read.robot.nominal, read.windows))
    console.out.print(_table(found))
    for number, winch in enumerate(found, start=1):
        console.out.print(_line(number, winch), markup=False, highlight=False)
    console.out.print(
        "offset is added to what the rig file had when this was recorded; mass and geometry are the robot file's: "
        "1 % of mass is 1 % of gain",
        markup=False,
    )
    if json_file is not None:
        winches = [{k: _finite(v) for k, v in asdict(winch).items()} for winch in found]
        json_file.write_text(json.dumps({"format": FORMAT, "winches": winches}, indent=1) + "\n", encoding="utf-8")
    return 1 if any(winch.problem for winch in found) else 0


def _table(found: tuple[WinchCalibration, ...]) -> Table:
    table = Table(title="Tension T = gain · I + offset, within ± friction")
    for column in ("winch", "gain, N/A", "sd", "offset, N", "sd", "friction, ± N", "tensions, N", "rests"):
        table.add_column(column, justify="right")
    for number, winch in enumerate(found, start=1):
        low, high = winch.range
        known = [f"{winch.gain:.2f}", f"{winch.sd_gain:.2f}", f"{winch.offset:+.2f}", f"{winch.sd_offset:.2f}"]
        middle = [*known, f"{winch.friction:.2f}"] if math.isfinite(winch.gain) else ["–"] * 5
        table.add_row(str(number), *middle, f"{low:.0f}–{high:.0f}", str(winch.rests))
    return table


def _line(number: int, winch: WinchCalibration) -> str:
    """What goes into the rig file, or why nothing does."""
    if winch.problem:
        return f"winch {number}: not usable, {winch.problem}; record rests whose tensions differ more"
    values = f"gain = {winch.gain:.2f}, offset = {winch.offset:.2f}, friction = {winch.friction:.2f}"
    return f"winch {number}: tension = {{ {values} }}"


def _finite(value: object) -> object:
    return None if isinstance(value, float) and not math.isfinite(value) else value
