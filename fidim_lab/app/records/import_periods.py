"""`fidim import periods`: from tables of a stopwatch's or a light gate's times to a campaign folder."""

from collections.abc import Sequence
from pathlib import Path

from fidim_lab.app.records.import_gyro import taped_lengths
from fidim_lab.app.terminal import console
from fidim_lab.data.campaign import NO_RATE, refuse_taken, write_campaign
from fidim_lab.data.files.json_file import write_json
from fidim_lab.data.importers.periods_csv import read_periods
from fidim_lab.data.records import Campaign
from fidim_lab.data.robot_file import read_robot
from fidim_lab.errors import FileError
from fidim_lab.identification.mle.periods.model import PeriodModel
from fidim_lab.identification.mle.starts.possible import nearest_possible
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.say import counted

PERIODS = "periods"


def import_periods_command(
    files: Sequence[Path], out: Path, robot_file: Path, lengths: Sequence[str], json_file: Path | None
) -> int:
    """Import, say what was found. Returns the exit code; raises FidimError."""
    refuse_taken(out)
    robot = read_robot(robot_file)
    taped = taped_lengths(lengths, len(files), robot.n) if lengths else [None] * len(files)
    rows = [row for path, held in zip(files, taped, strict=True) for row in read_periods(path, robot.n, held)]
    model = PeriodModel.of(Mechanism(robot), nearest_possible(robot.nominal), [row.period for row in rows])
    wrong = model.far_off()
    if wrong is not None:
        k, what, hint = wrong
        raise FileError(rows[k].path, f"line {rows[k].line}", what, hint=hint)
    comment = "encoder_resolution is the error of a length by tape."
    campaign = Campaign(out.name, robot, NO_RATE, (), periods=tuple(row.period for row in rows))
    write_campaign(out, campaign, robot_comment=comment)
    tilted = f", {counted(len(model.levels), 'tilt')} at rest" if model.levels else ""
    console.out.print(
        f"{counted(len(rows), 'period')} at {counted(len(model.hangings), 'set')} of lengths{tilted} in {out}; a "
        f"length by tape has {1e3 * robot.sensors.encoder_resolution:.2g} mm of error (encoder_resolution). fidim "
        f"identify {out} tells what they show of the body.",
        highlight=False,
    )
    if json_file is not None:
        said = [{"file": row.path.name, "line": row.line, "motion": row.period.motion or None} for row in rows]
        write_json(json_file, {"periods": said})
    return 0
