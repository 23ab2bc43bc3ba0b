"""Commands for what a session leaves: import, report, compare, check, export, play back.

Modules are imported when their command runs: `fidim --help` stays quick.
"""

import sys
from pathlib import Path

import click

from fidim_lab.app.cli.outputs import OUT_EITHER, OUT_FILE, OUT_FOLDER
from fidim_lab.app.cli.root import FOLDER, ROBOT, Number, example, fidim


@fidim.command("import")
@click.argument("kind")
@click.argument("sources", nargs=-1, required=True, type=FOLDER)
@click.option("--out", type=OUT_FOLDER, required=True, help="Campaign folder to write; must not exist yet.")
@click.option(
    "--robot", type=ROBOT, default=None, help="Robot file (or irma4) with the markers; every kind but irma4u, grab."
)
@click.option("--map", "map_file", type=FOLDER, default=None, help="csv: which column is what, fidim-columns/1.")
@click.option("--takes", default=None, metavar="WHICH", help="grab: numbers (1-36,40). Others: a pattern ('v_*.txt').")
@click.option("--log", "logs", multiple=True, metavar="PATTERN", help="Robot logs, by name or clock ('logs/r_*.log').")
@click.option("--log-map", type=FOLDER, default=None, help="Which column of the logs is what, fidim-log/1.")
@click.option("--topic", "topics", multiple=True, metavar="PATTERN", help="mcap, ros2-bag: which topics.")
@click.option("--up", type=click.Choice(["x", "y", "z"]), default=None, help="The file's axis that points upwards.")
@click.option("--unit", type=click.Choice(["m", "cm", "mm", "in"]), default=None, help="The file's unit of length.")
@click.option("--rate", type=Number(0, min_open=True), default=None, metavar="HZ", help="The file's frame rate.")
@click.option("--order", default=None, metavar="A,B,C", help="The file's markers in the robot file's order.")
@click.option("--body", default=None, metavar="NAME", help="Poses of this rigid body, not of the markers.")
@click.option("--cables", default=None, metavar="2,1,…", help="Which of the log's cables are the robot file's 1, 2, …")
@click.option("--json", "json_file", type=OUT_FILE, default=None, help="Write what was found for programs.")
@example("fidim import irma4u recordings/irma4u --out real")
@example("fidim import vicon-text take1.txt take2.txt --robot robot.toml --out takes")
@example(
    "fidim import c3d takes --takes 'free*.c3d' --robot robot.toml --log 'logs/*.log' --log-map log.toml --out all"
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
    json_file: Path | None,
) -> None:
    """Turn other labs' recordings of KIND into a campaign folder.

    KIND: irma4u, grab, vicon-text, vicon-csv, motive-csv, qtm-tsv, qtm-mat, trc, c3d, mcap, ros2-bag, csv. Several
    files become one campaign: each gives the windows of free motion that are found in it.
    """
    from fidim_lab.app.records.import_kinds import ImportOptions, cable_numbers, import_kind_command
    from fidim_lab.data.importers.takes import Asked

    names = tuple(name.strip() for name in order.split(",")) if order else ()
    asked = Asked(up, unit, names, body, rate, cable_numbers(cables) if cables else ())
    options = ImportOptions(robot, takes, map_file, logs, log_map, topics, asked)
    sys.exit(import_kind_command(kind, sources, out, options, json_file))


@fidim.command()
@click.argument("folder", type=FOLDER)
@click.option("--out", type=OUT_FILE, default=None, help="HTML file; default FOLDER/report.html.")
@click.option(
    "--pictures", type=OUT_FOLDER, default=None, help="Also write every picture as an SVG file into this folder."
)
@click.option("--json", "json_file", type=OUT_FILE, default=None, help='Write "fidim-report/1".')
@example("fidim report runs/dry-run-1 --pictures runs/dry-run-1/export/pictures")
def report(folder: Path, out: Path | None, pictures: Path | None, json_file: Path | None) -> None:
    """Write the HTML report of a run or campaign FOLDER: one file that opens offline.

    An explanation.json in FOLDER, as fidim explain --json writes it, becomes a section of its own.
    """
    from fidim_lab.app.report import report_command

    sys.exit(report_command(folder, out, pictures, json_file))


@fidim.command()
@click.argument("first", type=click.Path(path_type=Path))
@click.argument("second", type=click.Path(path_type=Path))
@click.option("--json", "json_file", type=OUT_FILE, default=None, help='Write "fidim-comparison/1".')
@click.option("--report", type=OUT_FILE, default=None, help="Write a self-contained HTML page.")
@example("fidim compare runs/monday runs/tuesday --report compare.html")
def compare(first: Path, second: Path, json_file: Path | None, report: Path | None) -> None:
    """Set two sessions side by side: run or campaign folders, or "fidim-result/1" files.

    Parameters with their difference in standard deviations, windows, tensions and verdicts. Exit 1 where a difference
    is larger than chance explains.
    """
    from fidim_lab.app.records.compare import compare_command

    sys.exit(compare_command(first, second, json_file, report))


@fidim.command()
@click.argument("folder", type=FOLDER)
@click.option("--json", "json_file", type=OUT_FILE, default=None, help='Write "fidim-verification/1".')
@example("fidim verify runs/dry-run-1")
def verify(folder: Path, json_file: Path | None) -> None:
    """Check every file of a run FOLDER against its manifest: exit 1 where one is changed, missing or extra."""
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
@click.option("--out", type=OUT_EITHER, default=None, help="File or folder to write; it must not exist yet.")
@click.option("--mass", type=Number(0, min_open=True), default=None, metavar="KG", help="urdf, mjcf need it.")
@click.option(
    "--campaign", type=FOLDER, default=None, help="That SOURCE is of: mjcf, python become the whole robot with cables."
)
@click.option("--window", default=None, metavar="ID", help="Of --campaign: where the robot begins; default held out.")
@click.option("--unfinished", is_flag=True, help="Also what is left of broken-off windows, in a folder of its own.")
@click.option("--json", "json_file", type=OUT_FILE, default=None, help='Write "fidim-export/1".')
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

    With --campaign also an "fidim-explanation/1" file: mjcf is the robot with its cables and the effects that were
    named, which MuJoCo runs; python a module of functions (lengths to pose and tensions, zero dynamics).
    """
    if campaign is None and window is not None:
        raise click.UsageError("--window goes with --campaign.")
    from fidim_lab.app.records.export import export_command

    robot = None if campaign is None else (campaign, window)
    sys.exit(export_command(source, kind, out, mass, unfinished=unfinished, json_file=json_file, robot=robot))


@fidim.command()
@click.argument("folder", type=FOLDER)
@click.option("--speed", type=Number(0), default=0.0, metavar="X", help="Times real time; 0: at once.")
@click.option("--json", "json_file", type=OUT_FILE, default=None, help='Write "fidim-replay/1".')
@example("fidim replay runs/dry-run-1")
def replay(folder: Path, speed: float, json_file: Path | None) -> None:
    """Play the raw bytes of a run FOLDER back through the drivers, and compare with what was recorded.

    Exit 1 at the first difference: the drivers now read the same bytes in another way.
    """
    from fidim_lab.app.records.replay import replay_command

    sys.exit(replay_command(folder, speed, json_file))


@fidim.command("ls")
@click.argument("folder", type=FOLDER, default=Path("runs"), required=False)
@click.option(
    "--failures", is_flag=True, help="Also which steps failed and which windows were rejected, over all runs."
)
@click.option("--json", "json_file", type=OUT_FILE, default=None, help='Write "fidim-history/1".')
@example("fidim ls runs --failures")
def ls(folder: Path, failures: bool, json_file: Path | None) -> None:
    """List the runs of FOLDER (default runs): when, who, robot, how each ended, what was found, notes."""
    from fidim_lab.app.records.history import ls_command

    sys.exit(ls_command(folder, json_file, failures=failures))
