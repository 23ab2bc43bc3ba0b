"""The `fidim` command: options in, exit code out (FORMAT.md). What a command does lives in a module of its own.

Modules are imported when their command runs: `fidim --help` stays quick.
"""

import os
import signal
import sys
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from types import FrameType
from typing import Any

import click

from fidim_lab.errors import FidimError

EXIT_WRONG_USE = 2
EXIT_OUR_BUG = 3
EXIT_INTERRUPTED = 130

FOLDER = click.Path(path_type=Path)
FILE = click.Path(path_type=Path, dir_okay=False)


def example(text: str) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Close a command's help with an example that can be typed."""

    def add(command: Callable[..., Any]) -> Callable[..., Any]:
        command.__doc__ = f"{command.__doc__}\n\n    \b\n    Example:\n      {text}\n    "
        return command

    return add


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(package_name="fidim-lab", prog_name="fidim")
def fidim() -> None:
    """Free-motion experiments on cable-suspended robots: acquire, identify, explain.

    Exit codes: 0 done; 1 done, and the answer is a refusal or a failed check; 2 wrong use or bad input; 3 hardware or a
    guard stopped it; 130 interrupted. Any command takes --debug, which shows where an error came from.
    """


@fidim.command("dry-run")
@click.option("--out", type=FOLDER, default=None, help="Run folder; default runs/dry-run-SEED, numbered if it exists.")
@click.option(
    "--seed", default=1, show_default=True, type=click.IntRange(0), help="Same seed, same windows, byte for byte."
)
@click.option("--robot", type=FILE, default=None, help="Robot file; default the paper's four-cable robot.")
@click.option("--equilibria", default=12, show_default=True, type=click.IntRange(1, 60))
@click.option(
    "--validate", "validation", default=3, show_default=True, type=click.IntRange(0, 60), help="Held-out windows."
)
@click.option("--hide", multiple=True, metavar="EFFECT[:key=value,…]", help="Hide physics in the simulated world.")
@click.option("--real-time", is_flag=True, help="Real python-can bus, real UDP sockets, real seconds.")
@click.option("--ui", is_flag=True, help="In real time, from the terminal UI: started, answered, stopped by keys.")
@click.option("--json", "json_file", type=FILE, default=None, help="Write the result for programs.")
@example("fidim dry-run --seed 7 --hide air-drag-linear:c=0.4")
def dry_run(**options: Any) -> None:
    """Rehearse the whole experiment on the embedded simulators, through the drivers' real bytes."""
    from fidim_lab.app.dry_run import DryRunOptions, run_dry_run

    sys.exit(run_dry_run(DryRunOptions(**options)))


@fidim.command()
@click.argument("campaign", type=FOLDER)
@click.option("--method", default=None, help="Estimator: mle, tls, ls or iv; default mle, or tls where it cannot work.")
@click.option("--paper", is_flag=True, help="TLS by the paper's words, beside the scaled and the weighted form.")
@click.option("--payload", type=FOLDER, default=None, help="Second campaign, with a known payload: finds the mass.")
@click.option("--mass", type=float, default=None, metavar="KG", help="Of the payload.")
@click.option("--mass-sd", type=click.FloatRange(0), default=0.0, metavar="KG", help="Its standard deviation.")
@click.option("--at", default=None, metavar="X,Y,Z", help="The payload's centre of mass in the body frame, m.")
@click.option("--at-sd", type=click.FloatRange(0), default=0.0, metavar="M", help="Standard deviation of each of them.")
@click.option(
    "--pose-from",
    "poses",
    type=click.Choice(["mocap", "swivel", "both"]),
    default="mocap",
    show_default=True,
    help="Markers; lengths, swivel angles s1… and inclination incl_x…; or all of them, weighted.",
)
@click.option("--json", "json_file", type=FILE, default=None, help='Write "fidim-result/1".')
@click.option("--report", type=FILE, default=None, help="Write a self-contained HTML report.")
@example(
    "fidim identify runs/dry-run-1 --json result.json\n"
    "      fidim identify empty --payload loaded --mass 1.000 --at 0,0.1,0.05"
)
def identify(
    campaign: Path,
    method: str | None,
    paper: bool,
    payload: Path | None,
    mass: float | None,
    mass_sd: float,
    at: str | None,
    at_sd: float,
    poses: str,
    json_file: Path | None,
    report: Path | None,
) -> None:
    """Find the platform's inertial parameters from the recorded free motion in CAMPAIGN."""
    from fidim_lab.app.identify import identify_command
    from fidim_lab.app.payload import parse_payload, payload_command
    from fidim_lab.identification.pose_sources import PoseSource

    if (known := parse_payload(payload, mass, at, mass_sd, at_sd)) is None:
        source = PoseSource(poses)
        sys.exit(identify_command(campaign, method, json_file, report, paper=paper, poses=source))
    if poses != PoseSource.MOCAP:
        raise click.UsageError("--pose-from does not go with --payload.")
    sys.exit(payload_command(campaign, known, method, json_file, report, paper=paper))


@fidim.command()
@click.argument("campaign", type=FOLDER)
@click.option("--parameters", type=FILE, required=True, help='A "fidim-result/1" file, as identify --json writes it.')
@click.option("--all", "everything", is_flag=True, help="Judge the windows of role 'identify' too.")
@click.option("--paper", is_flag=True, help="The σ_W in the result file is that of identify --paper.")
@click.option(
    "--limit", type=click.FloatRange(0, min_open=True), default=2.0, show_default=True, help="Largest χ²/dof."
)
@click.option("--json", "json_file", type=FILE, default=None, help='Write "fidim-validation/1".')
@example("fidim validate runs/dry-run-2 --parameters result.json")
def validate(**options: Any) -> None:
    """Check whether identified parameters predict the held-out windows of CAMPAIGN; exit 1 where they do not.

    Only each window's initial state is fitted. A window is predicted when χ²/dof of its trajectory is at most the
    limit; σ⊥ (Eq. 50) is shown beside σ_W, and decides (at most twice its expected value) for a window without lengths.
    """
    from fidim_lab.app.validate import ValidateOptions, validate_command

    sys.exit(validate_command(ValidateOptions(**options)))


@fidim.command()
@click.option("--seed", default=1, show_default=True, help="Of places and noise.")
@click.option(
    "--noise",
    type=click.FloatRange(0, min_open=True),
    default=1e-4,
    show_default=True,
    metavar="M",
    help="Standard deviation of a marker coordinate; the paper states ±0.2 mm.",
)
@click.option(
    "--validate", "validation", default=22, show_default=True, type=click.IntRange(1, 60), help="Windows of Fig. 3."
)
@click.option("--json", "json_file", type=FILE, default=None, help='Write "fidim-reproduction/1".')
@example("fidim reproduce --json reproduction.json")
def reproduce(**options: Any) -> None:
    """Simulate the paper's experiment and set its Eq. 46, 47, 49 and Fig. 3 beside ours, with what differs and why."""
    from fidim_lab.app.reproduce.command import ReproduceOptions, reproduce_command

    sys.exit(reproduce_command(ReproduceOptions(**options)))


@fidim.command("import")
@click.argument("kind")
@click.argument("sources", nargs=-1, required=True, type=FOLDER)
@click.option("--out", type=FOLDER, required=True, help="Campaign folder to write; must not exist yet.")
@click.option("--json", "json_file", type=FILE, default=None, help="Write what was found for programs.")
@example("fidim import irma4u recordings/irma4u --out real")
def import_(kind: str, sources: tuple[Path, ...], out: Path, json_file: Path | None) -> None:
    """Turn another lab's recording of KIND into a campaign folder."""
    from fidim_lab.app.import_recording import import_command

    sys.exit(import_command(kind, list(sources), out, json_file))


@fidim.command()
@click.option("--robot", type=FILE, required=True, help="Robot file.")
@click.option("--out", type=FOLDER, required=True, help="Campaign folder to write; must not exist yet.")
@click.option("--hide", multiple=True, metavar="EFFECT[:key=value,…]", help="Hide physics in the simulated world.")
@click.option("--backend", type=click.Choice(["native", "mujoco"]), default="native", show_default=True)
@click.option(
    "--noise", type=click.FloatRange(0), default=None, help="Marker noise, m; default that of the robot file."
)
@click.option("--seed", default=1, show_default=True, type=click.IntRange(0))
@click.option("--equilibria", default=12, show_default=True, type=click.IntRange(1, 60))
@click.option(
    "--validate", "validation", default=6, show_default=True, type=click.IntRange(0, 60), help="Held-out windows."
)
@click.option("--plan", type=FILE, default=None, help="Windows to record as they are, of fidim design; no random ones.")
@example("fidim simulate --robot robot.toml --out swivels --hide swivel-friction")
def simulate(**options: Any) -> None:
    """Write a campaign from the simulated world, with its truth beside it, without going through a bus."""
    from fidim_lab.app.simulate import SimulateOptions, simulate_command

    sys.exit(simulate_command(SimulateOptions(**options)))


@fidim.command()
@click.argument("campaign", type=FOLDER)
@click.option("--json", "json_file", type=FILE, default=None, help='Write "fidim-explanation/1".')
@click.option("--report", type=FILE, default=None, help="Write a self-contained HTML page with the proof.")
@click.option("--pictures", type=FOLDER, default=None, help="With --report: also every picture as an SVG file, here.")
@example("fidim explain runs/dry-run-1 --json explanation.json --report why.html")
def explain(campaign: Path, json_file: Path | None, report: Path | None, pictures: Path | None) -> None:
    """Name the physics that the model leaves out of CAMPAIGN, and show it on held-out windows.

    Every effect of the catalogue is tested; those that matter are fitted with the inertial parameters and accepted only
    where windows that no fit has seen are predicted better.
    """
    from fidim_lab.app.explain import explain_command

    if pictures is not None and report is None:
        raise click.UsageError("--pictures goes with --report.")
    sys.exit(explain_command(campaign, json_file, report, pictures))


@fidim.command()
@click.argument("folder", type=FOLDER)
@click.option("--out", type=FILE, default=None, help="HTML file; default FOLDER/report.html.")
@click.option("--pictures", type=FOLDER, default=None, help="Also write every picture as an SVG file into this folder.")
@example("fidim report runs/dry-run-1 --pictures runs/dry-run-1/export/pictures")
def report(folder: Path, out: Path | None, pictures: Path | None) -> None:
    """Write the HTML report of a run or campaign FOLDER: one file that opens offline.

    An explanation.json in FOLDER, as fidim explain --json writes it, becomes a section of its own.
    """
    from fidim_lab.app.report import report_command

    sys.exit(report_command(folder, out, pictures))


@fidim.command()
@click.argument("first", type=click.Path(path_type=Path))
@click.argument("second", type=click.Path(path_type=Path))
@click.option("--json", "json_file", type=FILE, default=None, help='Write "fidim-comparison/1".')
@click.option("--report", type=FILE, default=None, help="Write a self-contained HTML page.")
@example("fidim compare runs/monday runs/tuesday --report compare.html")
def compare(first: Path, second: Path, json_file: Path | None, report: Path | None) -> None:
    """Set two sessions side by side: run or campaign folders, or "fidim-result/1" files.

    Parameters with their difference in standard deviations, windows, tensions and verdicts. Exit 1 where a difference
    is larger than chance explains.
    """
    from fidim_lab.app.compare import compare_command

    sys.exit(compare_command(first, second, json_file, report))


@fidim.group(invoke_without_command=True)
@click.pass_context
def benchmark(context: click.Context) -> None:
    """Prove what the tool can do, on campaigns whose truth is sealed; without a name: list the benchmarks."""
    from fidim_lab.app import console
    from fidim_lab.app.benchmark.command import BENCHMARKS

    if context.invoked_subcommand is None:
        for name, says in BENCHMARKS.items():
            console.out.print(f"{name}    {says}", markup=False)


@benchmark.command("explain")
@click.option("--campaigns", default=12, show_default=True, type=click.IntRange(1), help="How many to seal.")
@click.option("--only", multiple=True, type=click.IntRange(1), help="Only the campaigns with these numbers.")
@click.option("--seed", default=1, show_default=True, type=click.IntRange(0), help="Of everything that is drawn.")
@click.option("--out", type=FOLDER, required=True, help="Folder of the benchmark; one that was cut off goes on.")
@click.option("--equilibria", default=12, show_default=True, type=click.IntRange(1, 60))
@click.option(
    "--validate", "validation", default=6, show_default=True, type=click.IntRange(1, 60), help="Held-out windows."
)
@click.option("--cap", default=600.0, show_default=True, type=click.FloatRange(1), help="CPU seconds for a campaign.")
@click.option("--processes", default=None, type=click.IntRange(1), help="Default: one for each core.")
@click.option("--scheduler", default=None, metavar="ADDRESS", help="Explain on a dask cluster instead.")
@click.option("--json", "json_file", type=FILE, default=None, help="Write the result for programs.")
@click.option("--page", type=FILE, default=None, help="Write the result as a page of docs.")
@example("fidim benchmark explain --campaigns 300 --out runs/sealed")
def benchmark_explain(**options: Any) -> None:
    """Seal campaigns with secrets of random size in random robots, explain them blind, open and score them."""
    from fidim_lab.app.benchmark.command import BenchmarkOptions, benchmark_command

    sys.exit(benchmark_command(BenchmarkOptions(**options)))


@fidim.command()
@click.argument("rig", type=FILE)
@click.option("--seed", default=1, show_default=True, type=click.IntRange(0), help="Of the true robot and all noise.")
@click.option("--hide", multiple=True, metavar="EFFECT[:key=value,…]", help="Hide physics in the simulated world.")
@click.option("--plan", type=FILE, default=None, help="Begin at rest at the first lengths of this plan.")
@click.option("--ports", default=None, metavar="BUS,MOCAP,HAND", help="Of 127.0.0.1, instead of what the rig names.")
@click.option("--until-input-ends", is_flag=True, hidden=True)
@example("fidim simulators examples/rigs/simulated.toml")
def simulators(**options: Any) -> None:
    """Simulate the devices of the RIG file for other processes, in real time, until Ctrl-C.

    Drives on its bus, motion capture at its socket, and a hand that answers prompts. A line typed here pulls a plug:
    bus, mocap, drive K (loses power), fault K.
    """
    from fidim_lab.app.simulators import SimulatorOptions, simulators_command

    sys.exit(simulators_command(SimulatorOptions(**options)))


@fidim.command()
@click.option("--robot", type=FILE, default=None, help="Robot file; default the paper's four-cable robot.")
@click.option("--equilibria", default=12, show_default=True, type=click.IntRange(1, 60))
@click.option("--samples", default=100, show_default=True, type=click.IntRange(1, 1000), help="Of each window, in W.")
@click.option("--starts", default=8, show_default=True, type=click.IntRange(1, 10_000))
@click.option(
    "--criterion",
    type=click.Choice(["C", "A", "D"]),
    default="C",
    show_default=True,
    help="C: the paper's Eq. 40; A, D: mean and volume of the variances that maximum likelihood will reach.",
)
@click.option(
    "--robust",
    default=0,
    show_default=True,
    type=click.IntRange(0, 50),
    help="Bodies 5 % off CAD to average A or D over.",
)
@click.option("--seed", default=1, show_default=True, type=click.IntRange(0))
@click.option("--out", type=FOLDER, default=None, help="Folder for plan.toml, design.json and equilibria.svg.")
@click.option("--json", "json_file", type=FILE, default=None, help="Write the design for programs (fidim-design/1).")
@click.option("--processes", type=click.IntRange(1), default=None, help="Local processes; default one a core.")
@click.option("--scheduler", default=None, metavar="ADDRESS", help="Of a dask cluster, instead of local processes.")
@click.option("--study", is_flag=True, help="C over 8–16 equilibria and 50–150 samples instead of one design.")
@example("fidim design --robot robot.toml --starts 20 --out design")
def design(**options: Any) -> None:
    """Find the equilibria and displacements whose free motion tells most about the body."""
    from fidim_lab.app.design import DesignOptions, design_command

    sys.exit(design_command(DesignOptions(**options)))


@fidim.command("power-off")
@click.argument("rig", type=FILE)
@click.option("--yes", is_flag=True, help="The load is secured; do not ask.")
@click.option(
    "--acknowledge", "acknowledged_by", default=None, metavar="NAME", help="Reset faults; NAME saw the cause."
)
@example("fidim power-off rig.toml")
def power_off(**options: Any) -> None:
    """Take the power from all drives of the RIG file, as after a run whose program has ended.

    Drives that lost their host hold the load in quick stop, and no other session takes them over until this is done.
    """
    from fidim_lab.app.power_off import PowerOffOptions, power_off_command

    sys.exit(power_off_command(PowerOffOptions(**options)))


@fidim.command()
@click.option("--robot", type=FILE, default=None, help="Also check this robot file for plausibility.")
@click.option("--rig", type=FILE, default=None, help="Also check this rig file's hardware; only reads, moves nothing.")
@click.option("--json", "json_file", type=FILE, default=None, help='Write "fidim-doctor/1".')
@example("fidim doctor --rig rig.toml")
def doctor(robot: Path | None, rig: Path | None, json_file: Path | None) -> None:
    """Check installation, buses, sockets, clock and disk, and say what to do where one fails.

    With --rig also each drive against the rig file (wanted, found), motion capture, guards and the robot file: exit 1
    where a check failed, 3 where something cannot be reached.
    """
    from fidim_lab.app.doctor import doctor_command

    sys.exit(doctor_command(robot, json_file, rig))


@fidim.command("run")
@click.argument("plan", type=FILE)
@click.option("--rig", type=FILE, required=True, help="Rig file.")
@click.option("--out", type=FOLDER, default=None, help="Run folder; default runs/PLAN, numbered if it exists.")
@click.option("--procedure", default="identify", show_default=True, help="Built-in procedure for a plan.")
@click.option("--list", "listing", is_flag=True, help="Print the steps and their times; nothing is opened.")
@click.option("--embedded", is_flag=True, help="Rehearse in real time on simulated devices in a child process.")
@click.option("--seed", default=1, show_default=True, type=click.IntRange(0), help="Of an embedded world.")
@click.option("--hide", multiple=True, metavar="EFFECT[:key=value,…]", help="Hide physics in an embedded world.")
@click.option("--set", "settings", multiple=True, metavar="TABLE.KEY=NUMBER", help="Change a setting of the procedure.")
@click.option("--unattended", is_flag=True, help="Refuse to start where a prompt has no stated answer.")
@click.option(
    "--answer", "answers", multiple=True, metavar="KIND=CHOICE[@S]", help="Answer a kind of prompt, after S s."
)
@click.option("--max-hours", type=click.FloatRange(0, min_open=True), default=None, help="End, held, after so long.")
@click.option("--quiet-hours", default=None, metavar="HH:MM-HH:MM", help="No window begins between them.")
@click.option("--on-finish", default="", metavar="COMMAND", help="Run after a run that ended well.")
@click.option("--on-fault", default="", metavar="COMMAND", help="Run after a run that did not.")
@click.option("--stay", is_flag=True, help="The service goes on after the run, for other clients.")
@click.option("--tcp", type=click.IntRange(0, 65535), default=None, help="Also listen at 127.0.0.1, with a token.")
@example("fidim run plan.toml --rig examples/rigs/simulated.toml --embedded")
def run_(**options: Any) -> None:
    """Run PLAN on a rig: a service in its own process owns the robot, this terminal watches and answers prompts.

    Ctrl-C aborts, with the robot held. The terminal may be closed: the run goes on, and prompts wait for a client.
    """
    from fidim_lab.app.run import RunOptions, run_command

    sys.exit(run_command(RunOptions(**options)))


@fidim.command()
@click.argument("folder", type=FOLDER, required=False)
@click.option("--rig", type=FILE, default=None, help="Attach to the service of this rig.")
@click.option("--light", is_flag=True, help="Dark on light.")
@click.option("--web", is_flag=True, help="In a browser on this computer, behind a token.")
@click.option("--port", default=8420, show_default=True, type=click.IntRange(1024, 65535), help="Of --web.")
@example("fidim ui runs/plan")
def ui(**options: Any) -> None:
    """Attach the terminal UI to a running service: that of FOLDER's run, of a rig, or the only one there is.

    It may be closed and attached again at any time; the run goes on. F12 is the emergency stop, on every screen.
    """
    from fidim_lab.app.ui import UiOptions, ui_command

    sys.exit(ui_command(UiOptions(**options)))


@fidim.command()
@click.argument("folder", type=FOLDER)
@click.option("--accept-place", is_flag=True, help="Go on from wherever the robot is: you have looked, or homed it.")
@example("fidim resume runs/plan")
def resume(folder: Path, accept_place: bool) -> None:
    """Go on with the run in FOLDER after a crash, a kill, a power cut or an abort.

    Windows that have their verdict stay; the open one is recorded again. Nothing moves where the robot is not where the
    journal left it.
    """
    from fidim_lab.app.resume import resume_command

    sys.exit(resume_command(folder, accept_place=accept_place))


@fidim.command()
@click.option("--rig", type=FILE, default=None, help="Only the service of this rig; default all of yours.")
@click.option("--reason", default="", help="For the journal.")
@example("fidim stop")
def stop(rig: Path | None, reason: str) -> None:
    """Emergency stop: quick-stop all winches now, latched. Not a substitute for the hardware button."""
    from fidim_lab.app.stop import stop_command

    sys.exit(stop_command(rig, reason))


@fidim.command("tension-calibrate")
@click.argument("campaign", type=FOLDER)
@click.option("--json", "json_file", type=FILE, default=None, help='Write "fidim-tension-calibration/1".')
@example("fidim tension-calibrate runs/poses")
def tension_calibrate(campaign: Path, json_file: Path | None) -> None:
    """Gain, offset and friction band of each winch from the rests of CAMPAIGN, as lines for the rig file.

    Motor currents are fitted on the tensions that statics give for the held cable lengths; mass and geometry are taken
    from the robot file. Exit 1 where the tensions differ too little to tell.
    """
    from fidim_lab.app.tension_calibrate import tension_calibrate_command

    sys.exit(tension_calibrate_command(campaign, json_file))


@fidim.command()
@click.argument("folder", type=FOLDER)
@click.option("--json", "json_file", type=FILE, default=None, help='Write "fidim-verification/1".')
@example("fidim verify runs/dry-run-1")
def verify(folder: Path, json_file: Path | None) -> None:
    """Check every file of a run FOLDER against its manifest: exit 1 where one is changed, missing or extra."""
    from fidim_lab.app.verify import verify_command

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
@click.option("--out", type=FOLDER, default=None, help="File or folder to write; it must not exist yet.")
@click.option("--mass", type=click.FloatRange(0, min_open=True), default=None, metavar="KG", help="urdf, mjcf need it.")
@click.option("--unfinished", is_flag=True, help="Also what is left of broken-off windows, in a folder of its own.")
@example("fidim export runs/dry-run-1 --to parquet\n      fidim export result.json --to mjcf --mass 11.98")
def export(source: Path, kind: str, out: Path | None, mass: float | None, unfinished: bool) -> None:
    """Export a campaign folder, or the parameters of a "fidim-result/1" file, for other programs."""
    from fidim_lab.app.export import export_command

    sys.exit(export_command(source, kind, out, mass, unfinished=unfinished))


@fidim.command()
@click.argument("folder", type=FOLDER)
@click.option("--speed", type=click.FloatRange(0), default=0.0, metavar="X", help="Times real time; 0: at once.")
@click.option("--json", "json_file", type=FILE, default=None, help='Write "fidim-replay/1".')
@example("fidim replay runs/dry-run-1")
def replay(folder: Path, speed: float, json_file: Path | None) -> None:
    """Play the raw bytes of a run FOLDER back through the drivers, and compare with what was recorded.

    Exit 1 at the first difference: the drivers now read the same bytes in another way.
    """
    from fidim_lab.app.replay import replay_command

    sys.exit(replay_command(folder, speed, json_file))


def run(arguments: Sequence[str]) -> int:
    """Run the command with these arguments and return its exit code; no traceback reaches a user without --debug."""
    debug = "--debug" in arguments
    try:
        fidim.main([a for a in arguments if a != "--debug"], prog_name="fidim", standalone_mode=False)
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else 0
    except (KeyboardInterrupt, click.Abort):
        click.echo("interrupted", err=True)
        return EXIT_INTERRUPTED
    except click.ClickException as error:
        error.show()
        return EXIT_WRONG_USE
    except FidimError as error:
        _explain(error, debug)
        return error.exit_code
    except BrokenPipeError:
        return 0
    except Exception as error:
        _explain(error, debug)
        click.echo("This is a bug of fidim-lab, not yours; --debug shows where it happened.", err=True)
        return EXIT_OUR_BUG
    return 0


def _explain(error: Exception, debug: bool) -> None:
    if debug:
        traceback.print_exception(error)
    sentence = str(error) if isinstance(error, FidimError) else f"{type(error).__name__}: {error}"
    click.echo(f"fidim: {sentence}", err=True)


def _terminate(number: int, frame: FrameType | None) -> None:
    """A polite kill is an interruption: the robot is held and the folder kept, as with Ctrl-C."""
    raise KeyboardInterrupt


def main() -> None:
    """Entry point of the `fidim` command."""
    # All our matrices are small: BLAS threads only wait for each other. To be said before numpy is imported.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    signal.signal(signal.SIGTERM, _terminate)
    sys.exit(run(sys.argv[1:]))
