"""Commands for recordings and results: import, report, compare, check, export, play back.

Modules are imported when their command runs: `fidim --help` stays quick.
"""

import sys
from pathlib import Path

import click

from fidim_lab.app.cli.options import answer_option
from fidim_lab.app.cli.outputs import OUT_EITHER, OUT_FILE, OUT_FOLDER
from fidim_lab.app.cli.root import FOLDER, ROBOT, Number, example, fidim


@fidim.command("import")
@click.argument("kind")
@click.argument("sources", nargs=-1, required=True, type=FOLDER)
@click.option("--out", type=OUT_FOLDER, required=True, help="Campaign folder to write; must not exist yet.")
@click.option(
    "--robot", type=ROBOT, help="Robot file (or irma4) with the markers; needed for every kind except irma4u and grab."
)
@click.option("--map", "map_file", type=FOLDER, help="csv: file that says what each column is (fidim-columns/1).")
@click.option(
    "--takes",
    metavar="WHICH",
    help="Which takes: numbers for grab (1-36,40), otherwise a file name pattern ('v_*.txt').",
)
@click.option(
    "--log",
    "logs",
    multiple=True,
    metavar="PATTERN",
    help="Logs of the robot ('logs/r_*.log'), assigned to the takes by name or by clock.",
)
@click.option("--log-map", type=FOLDER, help="File that says what each column of the logs is (fidim-log/1).")
@click.option("--topic", "topics", multiple=True, metavar="PATTERN", help="mcap, ros2-bag: topics to read.")
@click.option("--up", type=click.Choice(["x", "y", "z"]), help="The file's axis that points upwards.")
@click.option(
    "--unit",
    type=click.Choice(["m", "cm", "mm", "in", "rad/s", "deg/s"]),
    help="The file's unit of length; of angular rates for gyro.",
)
@click.option("--rate", type=Number(0, min_open=True), metavar="HZ", help="The file's frame rate.")
@click.option("--order", metavar="A,B,C", help="Names of the file's markers, in the order of the robot file.")
@click.option("--body", metavar="NAME", help="Use the poses of this rigid body instead of the markers.")
@click.option("--cables", metavar="2,1,…", help="Which of the log's cables are the robot file's 1, 2, …")
@click.option(
    "--lengths",
    multiple=True,
    metavar="M,M",
    help="gyro, periods: length of each cable by tape, m; once for all files, or once for each.",
)
@click.option("--axes", metavar="x,y,z", help="gyro: the phone's axes that point along x, y, z of the body.")
@click.option("--json", "json_file", type=OUT_FILE, help="Write what was found as JSON.")
@example(
    "fidim import irma4u recordings/irma4u --out real\n"
    "      fidim import vicon-text take1.txt take2.txt --robot robot.toml --out takes\n"
    "      fidim import c3d takes --takes 'free*.c3d' --robot robot.toml --log '*.log' --log-map log.toml --out all\n"
    "      fidim import periods times.csv --robot bifilar.toml --out timed"
)
def import_(
    kind: str,
    sources: tuple[Path, ...],
    out: Path,
    robot: Path | None,
    map_file: Path | None,
    takes: str | None,
    logs: tuple[str, ...],
    log_map: Path | None,
    topics: tuple[str, ...],
    up: str | None,
    unit: str | None,
    rate: float | None,
    order: str | None,
    body: str | None,
    cables: str | None,
    lengths: tuple[str, ...],
    axes: str | None,
    json_file: Path | None,
) -> None:
    """Turn other labs' recordings of KIND into a campaign folder.

    KIND: irma4u, grab, vicon-text, vicon-csv, motive-csv, qtm-tsv, qtm-mat, trc, c3d, mcap, ros2-bag, csv,
    gyro (a phone on a pendulum), periods (a table of a stopwatch's or a light gate's times). Several files become one
    campaign, which has the windows of free motion found in each of them.
    """
    from fidim_lab.app.records.import_kinds import ImportOptions, cable_numbers, import_kind_command
    from fidim_lab.data.importers.takes import Asked

    names = tuple(name.strip() for name in order.split(",")) if order else ()
    asked = Asked(up, unit, names, body, rate, cable_numbers(cables) if cables else ())
    options = ImportOptions(robot, takes, map_file, logs, log_map, topics, asked, lengths, axes)
    sys.exit(import_kind_command(kind, sources, out, options, json_file))


@fidim.command()
@click.argument("folder", type=FOLDER)
@click.option("--out", type=OUT_FILE, help="HTML file; default FOLDER/report.html.")
@click.option("--pictures", type=OUT_FOLDER, help="Also write every picture as an SVG file into this folder.")
@answer_option("fidim-report/1")
@example("fidim report runs/dry-run-1 --pictures runs/dry-run-1/export/pictures")
def report(folder: Path, out: Path | None, pictures: Path | None, json_file: Path | None) -> None:
    """Write the HTML report of a run or campaign FOLDER: one file that opens offline.

    If FOLDER has an explanation.json (from fidim explain --json), the report shows it in a section.
    """
    from fidim_lab.app.report import report_command

    sys.exit(report_command(folder, out, pictures, json_file))


@fidim.command()
@click.argument("first", type=click.Path(path_type=Path))
@click.argument("second", type=click.Path(path_type=Path))
@answer_option("fidim-comparison/1")
@click.option("--report", type=OUT_FILE, help="Write a self-contained HTML page.")
@example("fidim compare runs/monday runs/tuesday --report compare.html")
def compare(first: Path, second: Path, json_file: Path | None, report: Path | None) -> None:
    """Compare two sessions: run or campaign folders, or "fidim-result/1" files.

    Shows the parameters with their difference in standard deviations, the windows, tensions and verdicts. Exit code 1
    if a difference is larger than chance explains.
    """
    from fidim_lab.app.records.compare import compare_command

    sys.exit(compare_command(first, second, json_file, report))


@fidim.command()
@click.argument("folder", type=FOLDER)
@answer_option("fidim-verification/1")
@example("fidim verify runs/dry-run-1")
def verify(folder: Path, json_file: Path | None) -> None:
    """Check every file of a run FOLDER against its manifest; exit code 1 if one is changed, missing or extra."""
    from fidim_lab.app.records.verify import verify_command

    sys.exit(verify_command(folder, json_file))


@fidim.command()
@click.argument("source", type=FOLDER)
@click.option(
    "--to",
    "kind",
    required=True,
    type=click.Choice(["csv", "parquet", "mat", "mcap", "urdf", "mjcf", "python", "toml"]),
    help="csv, parquet, mat, mcap for a campaign; urdf, mjcf, python, toml for a result.",
)
@click.option("--out", type=OUT_EITHER, help="File or folder to write; it must not exist yet.")
@click.option(
    "--mass", type=Number(0, min_open=True), metavar="KG", help="Mass of the platform; urdf and mjcf need it."
)
@click.option(
    "--campaign",
    type=FOLDER,
    help="Campaign that SOURCE was computed from: mjcf and python then write the whole robot with its cables.",
)
@click.option(
    "--window", metavar="ID", help="With --campaign: window at whose start the robot begins; default: a held-out one."
)
@click.option(
    "--unfinished",
    is_flag=True,
    help="Also export unfinished windows, as far as they were recorded, into a separate folder.",
)
@answer_option("fidim-export/1")
@example(
    "fidim export runs/dry-run-1 --to parquet\n"
    "      fidim export result.json --to mjcf --mass 11.98\n"
    "      fidim export explanation.json --to mjcf --campaign runs/dry-run-1"
)
def export(
    source: Path,
    kind: str,
    out: Path | None,
    mass: float | None,
    campaign: Path | None,
    window: str | None,
    unfinished: bool,
    json_file: Path | None,
) -> None:
    """Export a campaign folder, or the parameters of a "fidim-result/1" file, for other programs.

    With --campaign, SOURCE may also be a "fidim-explanation/1" file. Then mjcf writes the robot with its cables and the
    named effects for MuJoCo; python writes a module of functions (lengths to pose and tensions, zero dynamics).
    """
    if campaign is None and window is not None:
        raise click.UsageError("--window needs --campaign.")
    from fidim_lab.app.records.export import export_command

    robot = None if campaign is None else (campaign, window)
    sys.exit(export_command(source, kind, out, mass, unfinished=unfinished, json_file=json_file, robot=robot))


@fidim.command()
@click.argument("folder", type=FOLDER)
@click.option(
    "--speed",
    type=Number(0),
    default=0.0,
    metavar="X",
    help="Playback speed, as a multiple of real time; 0: as fast as possible.",
)
@answer_option("fidim-replay/1")
@example("fidim replay runs/dry-run-1")
def replay(folder: Path, speed: float, json_file: Path | None) -> None:
    """Play the raw bytes of a run FOLDER back through the drivers, and compare with what was recorded.

    Exit code 1 at the first difference: today's drivers decode the same bytes to other values.
    """
    from fidim_lab.app.records.replay import replay_command

    sys.exit(replay_command(folder, speed, json_file))


@fidim.command("ls")
@click.argument("folder", type=FOLDER, default=Path("runs"), required=False)
@click.option("--failures", is_flag=True, help="Also count failed steps and rejected windows over all runs.")
@answer_option("fidim-history/1")
@example("fidim ls runs --failures")
def ls(folder: Path, failures: bool, json_file: Path | None) -> None:
    """List the runs in FOLDER (default runs): date, operator, robot, outcome, result, notes."""
    from fidim_lab.app.records.history import ls_command

    sys.exit(ls_command(folder, json_file, failures=failures))
