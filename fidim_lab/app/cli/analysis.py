"""Commands that compute: identify, explain, design, and the benchmarks.

Modules are imported when their command runs: `fidim --help` stays quick.
"""

import sys
from pathlib import Path
from typing import Any

import click

from fidim_lab.app.cli.completion import hide_option
from fidim_lab.app.cli.options import EQUILIBRIA, PROCESSES, SCHEDULER, answer_option, held_out_option, seed_option
from fidim_lab.app.cli.outputs import OUT_FILE, OUT_FILE_DEEP, OUT_FOLDER, Writing
from fidim_lab.app.cli.root import FILE, FOLDER, ROBOT, Number, example, fidim, given, not_with, nothing_but, only_with
from fidim_lab.errors import SetupError


@fidim.command()
@click.argument("campaigns", type=FOLDER, nargs=-1, required=True)
@click.option("--out", type=OUT_FILE, required=True, help="Robot file to write, in the frame of the motion capture.")
@answer_option("fidim-registration/1")
@example("fidim register session-1 session-2 --out registered.toml --json registration.json")
def register(campaigns: tuple[Path, ...], out: Path, json_file: Path | None) -> None:
    """Fit capture frame, markers and encoder zeros of CAMPAIGNS to their robot file.

    Writes a robot file with anchors, swivels and gravity in the frame of the motion capture; the recordings are not
    changed. Reports which anchor, marker or encoder disagrees.
    """
    from fidim_lab.app.analysis.register import register_command

    sys.exit(register_command(campaigns, out, json_file))


@fidim.command()
@click.argument("campaigns", type=FOLDER, nargs=-1, required=True)
@click.option("--method", help="Estimator: mle, tls, ls or iv; default mle, or tls where mle cannot be used.")
@click.option(
    "--paper",
    is_flag=True,
    help="Total least squares exactly as in the paper, beside the scaled and the weighted form.",
)
@click.option(
    "--payload", type=FOLDER, help="Second campaign, with a known payload; together they give the platform's mass."
)
@click.option(
    "--tare", type=FOLDER, help="Campaign of the empty platform: the difference of both bodies is what was put on it."
)
@click.option("--mass", type=Number(0, min_open=True), metavar="KG", help="Mass of the payload.")
@click.option(
    "--mass-sd",
    type=Number(0),
    default=0.0,
    metavar="KG",
    help="Standard deviation of --mass; with --tare, of the mass in each robot file.",
)
@click.option("--at", metavar="X,Y,Z", help="The payload's centre of mass in the body frame, m.")
@click.option(
    "--at-sd", type=Number(0), default=0.0, metavar="M", help="Standard deviation of each coordinate of --at."
)
@click.option(
    "--pose-from",
    "poses",
    type=click.Choice(["mocap", "swivel", "both"]),
    default="mocap",
    show_default=True,
    help="mocap: markers; swivel: lengths, swivel angles s1… and inclination incl_x…; both: all, weighted.",
)
@answer_option("fidim-result/1")
@click.option("--report", type=OUT_FILE, help="Write a self-contained HTML report.")
@example(
    "fidim identify runs/dry-run-1 --json result.json\n"
    "      fidim identify four-cables three-cables two-cables --report joint.html\n"
    "      fidim identify empty --payload loaded --mass 1.000 --at 0,0.1,0.05\n"
    "      fidim identify loaded --tare empty --json result.json"
)
def identify(
    campaigns: tuple[Path, ...],
    method: str | None,
    paper: bool,
    payload: Path | None,
    tare: Path | None,
    mass: float | None,
    mass_sd: float,
    at: str | None,
    at_sd: float,
    poses: str,
    json_file: Path | None,
    report: Path | None,
) -> None:
    """Find the platform's inertial parameters from the recorded free motion in CAMPAIGNS.

    Several campaigns of one platform, on the same cables or some of them, give one body and one geometry for all, and
    show how well each campaign predicts the others.
    """
    from fidim_lab.app.analysis.identify import identify_command
    from fidim_lab.app.analysis.payload import parse_payload, payload_command
    from fidim_lab.identification.motion.pose_sources import PoseSource

    campaign, *further = campaigns
    if further:
        not_with("a second campaign", "method", "paper", "payload", "tare", "mass", "mass_sd", "at", "at_sd", "poses")
        from fidim_lab.app.analysis.identify_jointly import identify_jointly_command

        sys.exit(identify_jointly_command(campaigns, json_file, report))
    if tare is not None:
        not_with("--tare", "paper", "payload", "mass", "at", "at_sd", "poses")
        from fidim_lab.app.analysis.tare import tare_command

        sys.exit(tare_command(campaign, tare, mass_sd, method, json_file, report))
    if (known := parse_payload(payload, mass, at, mass_sd, at_sd)) is None:
        source = PoseSource(poses)
        sys.exit(identify_command(campaign, method, json_file, report, paper=paper, poses=source))
    if poses != PoseSource.MOCAP:
        raise click.UsageError("--pose-from cannot be used with --payload.")
    sys.exit(payload_command(campaign, known, method, json_file, report, paper=paper))


@fidim.command()
@click.argument("campaign", type=FOLDER)
@click.option(
    "--parameters",
    type=FILE,
    required=True,
    help="Result file of identify --json, or of explain --json (then with the effects that it names).",
)
@click.option("--all", "everything", is_flag=True, help="Also judge the windows of role 'identify'.")
@click.option("--paper", is_flag=True, help="The result file was made with identify --paper, and so was its σ_W.")
@click.option(
    "--limit",
    type=Number(0, min_open=True),
    default=2.0,
    show_default=True,
    help="Largest χ²/dof of a window that counts as predicted.",
)
@answer_option("fidim-validation/1")
@example("fidim validate runs/dry-run-2 --parameters result.json")
def validate(**options: Any) -> None:
    """Check whether identified parameters predict the held-out windows of CAMPAIGN; exit code 1 if they do not.

    Only the initial state of each window is fitted. A window counts as predicted if χ²/dof of its trajectory is at most
    the limit. σ⊥ (Eq. 50) is shown beside σ_W; it decides (at most twice its expected value) for a window without
    lengths.
    """
    from fidim_lab.app.analysis.validate import ValidateOptions, validate_command

    sys.exit(validate_command(ValidateOptions(**options)))


@fidim.command()
@click.option("--seed", default=1, show_default=True, help="Random seed of poses and noise.")
@click.option(
    "--noise",
    type=Number(0, min_open=True),
    default=1e-4,
    show_default=True,
    metavar="M",
    help="Standard deviation of a marker coordinate; the paper states ±0.2 mm.",
)
@click.option(
    "--validate",
    "validation",
    default=22,
    show_default=True,
    type=click.IntRange(1, 60),
    help="Number of windows in Fig. 3.",
)
@click.option("--recordings", type=FOLDER, help="Folder of the paper's own takes, used instead of a simulation.")
@answer_option("fidim-reproduction/1")
@example("fidim reproduce --json reproduction.json\n      fidim reproduce --recordings grab")
def reproduce(recordings: Path | None, **options: Any) -> None:
    """Simulate the paper's experiment and compare its equations 46, 47, 49 and figure 3 with ours.

    With --recordings the paper's own takes are used instead, also with maximum likelihood, and the bodies found on 2, 3
    and 4 cables are compared ("fidim-recordings-reproduction/1").
    """
    if recordings is not None:
        not_with("--recordings", "seed", "noise", "validation")
        from benchmarks.reproduce.recordings import reproduce_recordings_command

        sys.exit(reproduce_recordings_command(recordings, options["json_file"]))
    from benchmarks.reproduce.command import ReproduceOptions, reproduce_command

    sys.exit(reproduce_command(ReproduceOptions(**options)))


@fidim.command()
@click.option("--robot", type=ROBOT, required=True, help="Robot file, or irma4, the paper's robot.")
@click.option("--out", type=OUT_FOLDER, required=True, help="Campaign folder to write; must not exist yet.")
@hide_option("Add this effect to the simulation; the model does not have it.")
@click.option(
    "--backend", type=click.Choice(["native", "mujoco"]), default="native", show_default=True, help="Simulator."
)
@click.option(
    "--noise", type=Number(0), help="Standard deviation of the marker noise, m; default: that of the robot file."
)
@seed_option()
@EQUILIBRIA
@held_out_option(6)
@click.option("--plan", type=FILE, help="Record this plan, for example from fidim design, instead of random windows.")
@click.option(
    "--own-sensors", is_flag=True, help="Also record swivel encoders s1… and an inclinometer incl_x…, for --pose-from."
)
@answer_option("fidim-simulation/1")
@example("fidim simulate --robot robot.toml --out swivels --hide swivel-friction")
def simulate(**options: Any) -> None:
    """Simulate a campaign without a bus, and write the true parameters beside it."""
    if options["plan"] is not None:
        not_with("--plan", "equilibria", "validation")
    from fidim_lab.app.analysis.simulate import SimulateOptions, simulate_command

    sys.exit(simulate_command(SimulateOptions(**options)))


@fidim.command()
@click.argument("campaign", type=FOLDER)
@answer_option("fidim-explanation/1")
@click.option("--report", type=OUT_FILE, help="Write a self-contained HTML page with the proof.")
@click.option(
    "--pictures", type=OUT_FOLDER, help="With --report: also write every picture as an SVG file into this folder."
)
@click.option(
    "--effort",
    type=Number(min=0),
    default=1.0,
    show_default=True,
    metavar="TIMES",
    help="Times the usual work after which the search ends and its best answer so far is given: counted, so that it "
    "is the same on every computer.",
)
@click.option(
    "--patience",
    type=Number(min=0),
    metavar="S",
    help="CPU seconds after which it ends as well. Default: no limit.",
)
@click.option("--without", multiple=True, metavar="EFFECT", help="Search without this effect of the catalogue.")
@example("fidim explain runs/dry-run-1 --json explanation.json --report why.html")
def explain(
    campaign: Path,
    json_file: Path | None,
    report: Path | None,
    pictures: Path | None,
    effort: float,
    patience: float | None,
    without: tuple[str, ...],
) -> None:
    """Name the physics in CAMPAIGN that the model leaves out, and test the answer on held-out windows.

    Every effect of the catalogue is tested. Those that matter are fitted with the inertial parameters, and accepted
    only if they improve the prediction of held-out windows.
    """
    from fidim_lab.app.analysis.explain import explain_command

    if pictures is not None and report is None:
        raise click.UsageError("--pictures needs --report.")
    _scored(without)
    sys.exit(explain_command(campaign, json_file, report, pictures, effort, patience, without))


def _scored(effects: tuple[str, ...]) -> None:
    """Raises UsageError for what no search tries, naming what it does try."""
    if not effects:
        return
    from fidim_lab.mismatch.linearised.hypotheses import check_known

    try:
        check_known(effects)
    except SetupError as error:
        raise click.UsageError(f"--{error.message} {error.hint}") from error


@fidim.group(invoke_without_command=True)
@click.pass_context
@example("fidim benchmark")
def benchmark(context: click.Context) -> None:
    """Measure what the tool can do, on campaigns whose truth is sealed. Without a name, list the benchmarks."""
    from benchmarks.sealed.command import BENCHMARKS
    from fidim_lab.app.terminal import console

    if context.invoked_subcommand is None:
        for name, says in BENCHMARKS.items():
            console.out.print(f"{name}    {says}", markup=False)


@benchmark.command("explain", cls=Writing)
@click.option("--campaigns", default=12, show_default=True, type=click.IntRange(1), help="Number of campaigns.")
@click.option("--only", multiple=True, type=click.IntRange(1), help="Only the campaigns with these numbers.")
@seed_option("Random seed of all campaigns.")
@click.option(
    "--out", type=OUT_FOLDER, required=True, help="Folder of the benchmark; an interrupted benchmark is continued."
)
@EQUILIBRIA
@held_out_option(6, least=1)
@click.option("--cap", default=600.0, show_default=True, type=Number(1), help="CPU seconds allowed for each campaign.")
@PROCESSES
@SCHEDULER
@click.option(
    "--without",
    default="",
    metavar="EFFECT",
    help="Hide this effect in each campaign and take it out of the catalogue; 'each': every effect in turn; "
    "'unlisted': in turn every simulated force that no catalogue has.",
)
@click.option(
    "--kind",
    type=click.Choice(["nothing", "one", "two", "three", "outside", "fault"]),
    help="What every campaign hides: so many effects, something outside the catalogue, a sensor fault. "
    "Default: some of each.",
)
@click.option("--surveyed", is_flag=True, help="All robot files are off by survey errors. Default: some are.")
@click.option("--json", "json_file", type=OUT_FILE_DEEP, help="Write the result as JSON.")
@click.option("--page", type=OUT_FILE_DEEP, help="Write the result as a documentation page.")
@example("fidim benchmark explain --campaigns 300 --out runs/sealed")
def benchmark_explain(**options: Any) -> None:
    """Simulate campaigns with secret effects of random size in random robots, explain them blind, score the answers."""
    from benchmarks.sealed.cases import TURNS
    from benchmarks.sealed.command import BenchmarkOptions, benchmark_command

    if options["without"]:
        not_with("--without", "kind")
    _scored((options["without"],) if options["without"] not in ("", *TURNS) else ())
    sys.exit(benchmark_command(BenchmarkOptions(**options)))


@fidim.command()
@click.option("--robot", type=ROBOT, help="Robot file; default: the paper's four-cable robot.")
@EQUILIBRIA
@click.option(
    "--samples",
    default=100,
    show_default=True,
    type=click.IntRange(1, 1000),
    help="Samples of each window in the regressor W.",
)
@click.option(
    "--starts", default=8, show_default=True, type=click.IntRange(1, 10_000), help="Random starts of the search."
)
@click.option(
    "--criterion",
    type=click.Choice(["C", "A", "D"]),
    default="C",
    show_default=True,
    help="C: the paper's Eq. 40; A: mean, D: volume of the variances that maximum likelihood will reach.",
)
@click.option(
    "--robust",
    default=0,
    show_default=True,
    type=click.IntRange(0, 50),
    help="Average criterion A or D over this many bodies that differ from CAD by 5 %.",
)
@seed_option()
@click.option("--out", type=OUT_FOLDER, help="Folder for plan.toml, design.json and equilibria.svg.")
@answer_option("fidim-design/1")
@PROCESSES
@SCHEDULER
@click.option(
    "--by-winches",
    is_flag=True,
    help="Only displacements that the winches can produce, for fidim run --procedure excite.",
)
@click.option(
    "--damping",
    default=0.08,
    show_default=True,
    type=Number(0, 0.2),
    help="With --by-winches: largest damping ratio to expect.",
)
@click.option(
    "--winch-speed",
    default=0.5,
    show_default=True,
    type=Number(0, min_open=True),
    metavar="M/S",
    help="With --by-winches: largest speed of any cable.",
)
@click.option(
    "--winch-acceleration",
    default=1.0,
    show_default=True,
    type=Number(0, min_open=True),
    metavar="M/S²",
    help="With --by-winches: largest acceleration of any cable.",
)
@click.option(
    "--study", is_flag=True, help="Instead of one design, compare criterion C for 8–16 equilibria and 50–150 samples."
)
@click.option("--after", type=FILE, help="Propose what to record next, after this explanation.json or result.json.")
@click.option("--campaign", type=FOLDER, help="With --after: its campaign; default: the folder of that file.")
@example(
    "fidim design --robot robot.toml --starts 20 --out design\n"
    "      fidim design --after runs/dry-run-1/explanation.json --out next"
)
def design(after: Path | None, campaign: Path | None, **options: Any) -> None:
    """Find the equilibria and displacements whose free motion is most informative about the body.

    With --after it proposes what to record next. After an explanation: windows that separate the effects which the
    recordings could not separate, with the odds; exit code 1, and no plan, if no window does. After a result, or if no
    effect is in question: the window that is most informative about the body, by --criterion A (the default then) or D.
    Other options allowed with --after are --campaign, --seed, --out and --json.
    """
    if after is not None:
        nothing_but("--after", "after", "campaign", "criterion", "seed", "out", "json_file")
        from fidim_lab.app.analysis.design_after import AfterOptions, after_command
        from fidim_lab.identification.design.task import Criterion

        criterion = Criterion(options["criterion"]) if given(["criterion"]) else None
        sys.exit(
            after_command(
                AfterOptions(after, campaign, criterion, options["seed"], options["out"], options["json_file"])
            )
        )
    only_with("--after", "campaign")
    if not options["by_winches"]:
        only_with("--by-winches", "damping", "winch_speed", "winch_acceleration")
    from fidim_lab.app.analysis.design import DesignOptions, design_command

    sys.exit(design_command(DesignOptions(**options)))
