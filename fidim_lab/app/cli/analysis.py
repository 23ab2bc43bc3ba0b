"""Commands that compute: identify, explain, design and what proves them.

Modules are imported when their command runs: `fidim --help` stays quick.
"""

import sys
from pathlib import Path
from typing import Any

import click

from fidim_lab.app.cli.completion import hide_option
from fidim_lab.app.cli.outputs import OUT_FILE, OUT_FILE_DEEP, OUT_FOLDER, Writing
from fidim_lab.app.cli.root import FILE, FOLDER, ROBOT, Number, example, fidim, given, not_with, nothing_but, only_with
from fidim_lab.errors import SetupError
from fidim_lab.mismatch.selection.budget import PATIENCE


@fidim.command()
@click.argument("campaigns", type=FOLDER, nargs=-1, required=True)
@click.option("--out", type=OUT_FILE, required=True, help="Robot file to write, in the frame of the motion capture.")
@click.option("--json", "json_file", type=OUT_FILE, default=None, help='Write "fidim-registration/1".')
@example("fidim register session-1 session-2 --out registered.toml --json registration.json")
def register(campaigns: tuple[Path, ...], out: Path, json_file: Path | None) -> None:
    """Place capture frame, markers and encoder zeros of CAMPAIGNS against their robot file.

    Writes the robot file with anchors, swivels and gravity in the frame of the motion capture: recordings stay as they
    are. Says which anchor, marker or encoder disagrees.
    """
    from fidim_lab.app.analysis.register import register_command

    sys.exit(register_command(campaigns, out, json_file))


@fidim.command()
@click.argument("campaigns", type=FOLDER, nargs=-1, required=True)
@click.option("--method", default=None, help="Estimator: mle, tls, ls or iv; default mle, or tls where it cannot work.")
@click.option("--paper", is_flag=True, help="TLS by the paper's words, beside the scaled and the weighted form.")
@click.option("--payload", type=FOLDER, default=None, help="Second campaign, with a known payload: finds the mass.")
@click.option("--mass", type=Number(0, min_open=True), default=None, metavar="KG", help="Of the payload.")
@click.option("--mass-sd", type=Number(0), default=0.0, metavar="KG", help="Its standard deviation.")
@click.option("--at", default=None, metavar="X,Y,Z", help="The payload's centre of mass in the body frame, m.")
@click.option("--at-sd", type=Number(0), default=0.0, metavar="M", help="Standard deviation of each of them.")
@click.option(
    "--pose-from",
    "poses",
    type=click.Choice(["mocap", "swivel", "both"]),
    default="mocap",
    show_default=True,
    help="Markers; lengths, swivel angles s1… and inclination incl_x…; or all of them, weighted.",
)
@click.option("--json", "json_file", type=OUT_FILE, default=None, help='Write "fidim-result/1".')
@click.option("--report", type=OUT_FILE, default=None, help="Write a self-contained HTML report.")
@example(
    "fidim identify runs/dry-run-1 --json result.json\n"
    "      fidim identify four-cables three-cables two-cables --report joint.html\n"
    "      fidim identify empty --payload loaded --mass 1.000 --at 0,0.1,0.05"
)
def identify(
    campaigns: tuple[Path, ...],
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
    """Find the platform's inertial parameters from the recorded free motion in CAMPAIGNS.

    Of several campaigns of one platform, with the same cables or some of them: one body and one geometry for all, and
    how well some of them predict the others.
    """
    from fidim_lab.app.analysis.identify import identify_command
    from fidim_lab.app.analysis.payload import parse_payload, payload_command
    from fidim_lab.identification.motion.pose_sources import PoseSource

    campaign, *further = campaigns
    if further:
        not_with("a second campaign", "method", "paper", "payload", "mass", "mass_sd", "at", "at_sd", "poses")
        from fidim_lab.app.analysis.identify_jointly import identify_jointly_command

        sys.exit(identify_jointly_command(campaigns, json_file, report))
    if (known := parse_payload(payload, mass, at, mass_sd, at_sd)) is None:
        source = PoseSource(poses)
        sys.exit(identify_command(campaign, method, json_file, report, paper=paper, poses=source))
    if poses != PoseSource.MOCAP:
        raise click.UsageError("--pose-from does not go with --payload.")
    sys.exit(payload_command(campaign, known, method, json_file, report, paper=paper))


@fidim.command()
@click.argument("campaign", type=FOLDER)
@click.option(
    "--parameters",
    type=FILE,
    required=True,
    help="A file of identify --json, or of explain --json: with the effects that it names.",
)
@click.option("--all", "everything", is_flag=True, help="Judge the windows of role 'identify' too.")
@click.option("--paper", is_flag=True, help="The σ_W in the result file is that of identify --paper.")
@click.option("--limit", type=Number(0, min_open=True), default=2.0, show_default=True, help="Largest χ²/dof.")
@click.option("--json", "json_file", type=OUT_FILE, default=None, help='Write "fidim-validation/1".')
@example("fidim validate runs/dry-run-2 --parameters result.json")
def validate(**options: Any) -> None:
    """Check whether identified parameters predict the held-out windows of CAMPAIGN; exit 1 where they do not.

    Only each window's initial state is fitted. A window is predicted when χ²/dof of its trajectory is at most the
    limit; σ⊥ (Eq. 50) is shown beside σ_W, and decides (at most twice its expected value) for a window without lengths.
    """
    from fidim_lab.app.analysis.validate import ValidateOptions, validate_command

    sys.exit(validate_command(ValidateOptions(**options)))


@fidim.command()
@click.option("--seed", default=1, show_default=True, help="Of places and noise.")
@click.option(
    "--noise",
    type=Number(0, min_open=True),
    default=1e-4,
    show_default=True,
    metavar="M",
    help="Standard deviation of a marker coordinate; the paper states ±0.2 mm.",
)
@click.option(
    "--validate", "validation", default=22, show_default=True, type=click.IntRange(1, 60), help="Windows of Fig. 3."
)
@click.option("--recordings", type=FOLDER, default=None, help="Folder of the paper's own takes: no simulation.")
@click.option("--json", "json_file", type=OUT_FILE, default=None, help='Write "fidim-reproduction/1".')
@example("fidim reproduce --json reproduction.json\n      fidim reproduce --recordings grab")
def reproduce(recordings: Path | None, **options: Any) -> None:
    """Simulate the paper's experiment and set its equations 46, 47, 49 and figure 3 beside ours, with the reasons.

    With --recordings the same from the paper's own takes, maximum likelihood beside them, and the bodies by 2, 3 and 4
    cables against each other ("fidim-recordings-reproduction/1").
    """
    if recordings is not None:
        not_with("--recordings", "seed", "noise", "validation")
        from fidim_lab.app.reproduce.recordings import reproduce_recordings_command

        sys.exit(reproduce_recordings_command(recordings, options["json_file"]))
    from fidim_lab.app.reproduce.command import ReproduceOptions, reproduce_command

    sys.exit(reproduce_command(ReproduceOptions(**options)))


@fidim.command()
@click.option("--robot", type=ROBOT, required=True, help="Robot file, or irma4: the paper's.")
@click.option("--out", type=OUT_FOLDER, required=True, help="Campaign folder to write; must not exist yet.")
@hide_option("Hide physics in the simulated world.")
@click.option("--backend", type=click.Choice(["native", "mujoco"]), default="native", show_default=True)
@click.option("--noise", type=Number(0), default=None, help="Marker noise, m; default that of the robot file.")
@click.option("--seed", default=1, show_default=True, type=click.IntRange(0))
@click.option("--equilibria", default=12, show_default=True, type=click.IntRange(1, 60))
@click.option(
    "--validate", "validation", default=6, show_default=True, type=click.IntRange(0, 60), help="Held-out windows."
)
@click.option("--plan", type=FILE, default=None, help="Windows to record as they are, of fidim design; no random ones.")
@click.option(
    "--own-sensors", is_flag=True, help="Record swivel encoders s1… and an inclinometer incl_x… too, for --pose-from."
)
@click.option("--json", "json_file", type=OUT_FILE, default=None, help='Write "fidim-simulation/1".')
@example("fidim simulate --robot robot.toml --out swivels --hide swivel-friction")
def simulate(**options: Any) -> None:
    """Write a campaign from the simulated world, with its truth beside it, without going through a bus."""
    if options["plan"] is not None:
        not_with("--plan", "equilibria", "validation")
    from fidim_lab.app.analysis.simulate import SimulateOptions, simulate_command

    sys.exit(simulate_command(SimulateOptions(**options)))


@fidim.command()
@click.argument("campaign", type=FOLDER)
@click.option("--json", "json_file", type=OUT_FILE, default=None, help='Write "fidim-explanation/1".')
@click.option("--report", type=OUT_FILE, default=None, help="Write a self-contained HTML page with the proof.")
@click.option(
    "--pictures", type=OUT_FOLDER, default=None, help="With --report: also every picture as an SVG file, here."
)
@click.option(
    "--patience",
    type=Number(min=0),
    default=PATIENCE,
    show_default=True,
    metavar="S",
    help="CPU seconds until what there is, is told.",
)
@click.option("--without", multiple=True, metavar="EFFECT", help="Explain as if the catalogue lacked this effect.")
@example("fidim explain runs/dry-run-1 --json explanation.json --report why.html")
def explain(
    campaign: Path,
    json_file: Path | None,
    report: Path | None,
    pictures: Path | None,
    patience: float,
    without: tuple[str, ...],
) -> None:
    """Name the physics that the model leaves out of CAMPAIGN, and show it on held-out windows.

    Every effect of the catalogue is tested; those that matter are fitted with the inertial parameters and accepted only
    where windows that no fit has seen are predicted better.
    """
    from fidim_lab.app.analysis.explain import explain_command

    if pictures is not None and report is None:
        raise click.UsageError("--pictures goes with --report.")
    _scored(without)
    sys.exit(explain_command(campaign, json_file, report, pictures, patience, without))


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
    """Prove what the tool can do, on campaigns whose truth is sealed; without a name: list the benchmarks."""
    from fidim_lab.app.benchmark.command import BENCHMARKS
    from fidim_lab.app.terminal import console

    if context.invoked_subcommand is None:
        for name, says in BENCHMARKS.items():
            console.out.print(f"{name}    {says}", markup=False)


@benchmark.command("explain", cls=Writing)
@click.option("--campaigns", default=12, show_default=True, type=click.IntRange(1), help="How many to seal.")
@click.option("--only", multiple=True, type=click.IntRange(1), help="Only the campaigns with these numbers.")
@click.option("--seed", default=1, show_default=True, type=click.IntRange(0), help="Of everything that is drawn.")
@click.option("--out", type=OUT_FOLDER, required=True, help="Folder of the benchmark; one that was cut off goes on.")
@click.option("--equilibria", default=12, show_default=True, type=click.IntRange(1, 60))
@click.option(
    "--validate", "validation", default=6, show_default=True, type=click.IntRange(1, 60), help="Held-out windows."
)
@click.option("--cap", default=600.0, show_default=True, type=Number(1), help="CPU seconds for a campaign.")
@click.option("--processes", default=None, type=click.IntRange(1), help="Default: one for each core.")
@click.option("--scheduler", default=None, metavar="ADDRESS", help="Explain on a dask cluster instead.")
@click.option(
    "--without",
    default="",
    metavar="EFFECT",
    help="Hide it in each campaign, the catalogue lacks it; 'each': every effect in its turn.",
)
@click.option("--json", "json_file", type=OUT_FILE_DEEP, default=None, help="Write the result for programs.")
@click.option("--page", type=OUT_FILE_DEEP, default=None, help="Write the result as a page of docs.")
@example("fidim benchmark explain --campaigns 300 --out runs/sealed")
def benchmark_explain(**options: Any) -> None:
    """Seal campaigns with secrets of random size in random robots, explain them blind, open and score them."""
    from fidim_lab.app.benchmark.cases import EACH
    from fidim_lab.app.benchmark.command import BenchmarkOptions, benchmark_command

    _scored((options["without"],) if options["without"] not in ("", EACH) else ())
    sys.exit(benchmark_command(BenchmarkOptions(**options)))


@fidim.command()
@click.option("--robot", type=ROBOT, default=None, help="Robot file; default the paper's four-cable robot.")
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
@click.option("--out", type=OUT_FOLDER, default=None, help="Folder for plan.toml, design.json and equilibria.svg.")
@click.option(
    "--json", "json_file", type=OUT_FILE, default=None, help="Write the design for programs (fidim-design/1)."
)
@click.option("--processes", type=click.IntRange(1), default=None, help="Local processes; default one a core.")
@click.option("--scheduler", default=None, metavar="ADDRESS", help="Of a dask cluster, instead of local processes.")
@click.option(
    "--by-winches", is_flag=True, help="Displacements that winches can give, for fidim run --procedure excite."
)
@click.option(
    "--damping", default=0.08, show_default=True, type=Number(0, 0.2), help="Most there may be, --by-winches."
)
@click.option(
    "--winch-speed",
    default=0.5,
    show_default=True,
    type=Number(0, min_open=True),
    metavar="M/S",
    help="Of any cable, --by-winches.",
)
@click.option(
    "--winch-acceleration",
    default=1.0,
    show_default=True,
    type=Number(0, min_open=True),
    metavar="M/S²",
    help="Likewise.",
)
@click.option("--study", is_flag=True, help="C over 8–16 equilibria and 50–150 samples instead of one design.")
@click.option(
    "--after", type=FILE, default=None, help="What to record next after an explanation.json or a result.json."
)
@click.option("--campaign", type=FOLDER, default=None, help="Of --after; default the folder that the file is in.")
@example(
    "fidim design --robot robot.toml --starts 20 --out design\n"
    "      fidim design --after runs/dry-run-1/explanation.json --out next"
)
def design(after: Path | None, campaign: Path | None, **options: Any) -> None:
    """Find the equilibria and displacements whose free motion tells most about the body.

    With --after: those that tell effects apart that the recordings could not, with the odds; exit 1, and no plan, where
    none does. After a result, or where nothing is in question, the window that tells most about the body, by
    --criterion A (unless given) or D. Of the other options it takes --campaign, --seed, --out and --json.
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
