"""Commands of a session at the robot, real or simulated.

Modules are imported when their command runs: `fidim --help` stays quick.
"""

import sys
from pathlib import Path
from typing import Any

import click

from fidim_lab.app.cli.completion import hide_option
from fidim_lab.app.cli.options import EMBEDDED, EQUILIBRIA, LISTING, YES, answer_option, held_out_option, seed_option
from fidim_lab.app.cli.outputs import OUT_EITHER, OUT_FILE, OUT_FOLDER
from fidim_lab.app.cli.root import FILE, FOLDER, ROBOT, Number, example, fidim, not_with, only_with


@fidim.command("dry-run")
@click.option("--out", type=OUT_FOLDER, help="Run folder; default runs/dry-run-SEED, numbered if it exists.")
@seed_option("Random seed; the same seed gives the same windows, byte for byte.")
@click.option("--robot", type=ROBOT, help="Robot file; default: the paper's four-cable robot.")
@EQUILIBRIA
@held_out_option(3)
@click.option("--plan", type=FILE, help="Rehearse this plan instead of a random one.")
@click.option(
    "--excite", is_flag=True, help="The winches excite the platform, not a hand (fidim run --procedure excite)."
)
@hide_option("Add this effect to the simulation; the model does not have it.")
@click.option("--real-time", is_flag=True, help="Use a real python-can bus and real UDP sockets, in real time.")
@click.option(
    "--ui",
    is_flag=True,
    help="Rehearse from the terminal UI, in real time: keys start the run, answer prompts and stop it.",
)
@click.option("--light", is_flag=True, help="With --ui: dark text on a light background.")
@click.option("--json", "json_file", type=OUT_FILE, help="Write the result as JSON.")
@example("fidim dry-run --seed 7 --hide air-drag-linear:c=0.4")
def dry_run(**options: Any) -> None:
    """Rehearse the whole experiment on embedded simulators, which exchange real bytes with the drivers."""
    if options["ui"]:
        not_with("--ui", "json_file")
    else:
        only_with("--ui", "light")
    if options["plan"] is not None:
        not_with("--plan", "equilibria", "validation")
    from fidim_lab.app.session.dry_run import run_dry_run
    from fidim_lab.app.session.dry_run_plan import DryRunOptions

    sys.exit(run_dry_run(DryRunOptions(**options)))


@fidim.command("run")
@click.argument("plan", type=FILE)
@click.option("--rig", type=FILE, required=True, help="Rig file.")
@click.option("--out", type=OUT_FOLDER, help="Run folder; default runs/PLAN, numbered if it exists.")
@click.option(
    "--procedure",
    default="identify",
    show_default=True,
    metavar="NAME|FILE.py",
    help="A built-in procedure, or a file of your own (docs/procedures.md).",
)
@LISTING
@EMBEDDED
@seed_option("With --embedded: random seed of the simulation.")
@hide_option("With --embedded: add this effect to the simulation; the model does not have it.")
@click.option("--set", "settings", multiple=True, metavar="TABLE.KEY=NUMBER", help="Change a setting of the procedure.")
@click.option("--unattended", is_flag=True, help="Nobody is there: refuse to start if a prompt has no --answer.")
@click.option(
    "--answer",
    "answers",
    multiple=True,
    metavar="KIND=CHOICE[@S]",
    help="Answer prompts of this kind with CHOICE, after S seconds.",
)
@click.option(
    "--max-hours", type=Number(0, min_open=True), help="End the run after so many hours, with the robot held."
)
@click.option("--quiet-hours", metavar="HH:MM-HH:MM", help="Begin no window between these times of day.")
@click.option("--on-finish", default="", metavar="COMMAND", help="Command to execute after a successful run.")
@click.option("--on-fault", default="", metavar="COMMAND", help="Command to execute after any other run.")
@click.option("--operator", metavar="NAME", help="Your name, for fidim ls; default: your user name.")
@click.option("--note", default="", metavar="TEXT", help="A note on this run, for fidim ls.")
@click.option("--stay", is_flag=True, help="Keep the service running after the run, until fidim shutdown.")
@click.option(
    "--tcp", type=click.IntRange(0, 65535), help="Also listen on this port of 127.0.0.1; clients need a token."
)
@answer_option("fidim-summary/1")
@example("fidim run plan.toml --rig examples/rigs/simulated.toml --embedded")
def run_(**options: Any) -> None:
    """Run PLAN on a rig: a separate process controls the robot; this terminal shows messages and answers prompts.

    Ctrl-C aborts the run and leaves the robot held. The terminal may be closed: the run continues, and prompts wait
    until a client is attached.
    """
    if not options["embedded"]:  # only simulated devices hide something
        only_with("--embedded", "hide", "seed")
    from fidim_lab.app.session.run import RunOptions, run_command

    sys.exit(run_command(RunOptions(**options)))


@fidim.command()
@click.argument("folder", type=FOLDER, required=False)
@click.option("--rig", type=FILE, help="Attach to the service of this rig.")
@click.option("--light", is_flag=True, help="Dark text on a light background.")
@click.option("--web", is_flag=True, help="Show the UI in a browser on this computer, protected by a token.")
@click.option(
    "--port", default=8420, show_default=True, type=click.IntRange(1024, 65535), help="With --web: port to listen on."
)
@example("fidim ui runs/plan")
def ui(**options: Any) -> None:
    """Attach the terminal UI to a running service: of the run in FOLDER, of a rig, or the only one that is running.

    It may be closed and attached again at any time; the run continues. F12 is the emergency stop on every screen.
    """
    if not options["web"]:
        only_with("--web", "port")
    from fidim_lab.app.session.ui import UiOptions, ui_command

    sys.exit(ui_command(UiOptions(**options)))


@fidim.command()
@click.argument("folder", type=FOLDER)
@click.option(
    "--accept-place",
    is_flag=True,
    help="Continue from where the robot is now: you have checked its position, or homed it.",
)
@click.option("--trust", is_flag=True, help="Execute commands and files that run.json names without asking.")
@answer_option("fidim-summary/1")
@example("fidim resume runs/plan")
def resume(**options: Any) -> None:
    """Continue the run in FOLDER after an emergency stop, a crash, a power cut or an abort.

    Judged windows are kept; the unfinished one is recorded again. Nothing moves if the robot is not where the journal
    says it was left. A latched emergency stop must first be reset by answering "yes" to two questions.
    """
    from fidim_lab.app.session.resume import ResumeOptions, resume_command

    sys.exit(resume_command(ResumeOptions(**options)))


class _Hasty(click.Command):
    """A command that is carried out however it was typed; what it does not understand is given to it as a text."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """As click does it, but where click refuses, no option holds."""
        typed = list(args)
        try:
            left = super().parse_args(ctx, args)
        except click.UsageError:
            left = typed
            super().parse_args(ctx, [])
        ctx.params["not_understood"] = " ".join(left)
        return left


@fidim.command(cls=_Hasty, context_settings={"ignore_unknown_options": True, "allow_extra_args": True})
@click.option("--rig", type=FILE, help="Stop only the service of this rig; default: all your services.")
@click.option("--reason", default="", help="Reason, written to the journal.")
@answer_option("fidim-stop/1", FILE)  # a stop waits for no path
@example("fidim stop")
def stop(rig: Path | None, reason: str, json_file: Path | None, not_understood: str) -> None:
    """Emergency stop: quick-stop all winches now, latched. Not a substitute for the hardware button.

    A mistake in the command line does not prevent the stop: then all your services are stopped.
    """
    from fidim_lab.app.session.stop import stop_command

    sys.exit(stop_command(rig, reason, not_understood, json_file))


@fidim.command()
@click.argument("folder", type=FOLDER, required=False)
@click.option("--rig", type=FILE, help="Rig file; default: that of the run in FOLDER.")
@answer_option("fidim-reset/1")
@example("fidim reset --rig rig.toml")
def reset(folder: Path | None, rig: Path | None, json_file: Path | None) -> None:
    """Reset an emergency stop after two questions: has its cause been removed, and is nobody at the cables?

    Nothing moves. The stop is stored beside the rig file, so no service needs to run. fidim run and fidim resume ask
    the same questions.
    """
    from fidim_lab.app.session.undo_stop import reset_command

    sys.exit(reset_command(folder, rig, json_file))


@fidim.command()
@click.argument("folder", type=FOLDER, required=False)
@click.option("--rig", type=FILE, help="End the service of this rig.")
@answer_option("fidim-shutdown/1")
@example("fidim shutdown")
def shutdown(folder: Path | None, rig: Path | None, json_file: Path | None) -> None:
    """End a service whose run has ended (fidim run --stay) or has not begun; refused during a run."""
    from fidim_lab.app.session.shutdown import shutdown_command

    sys.exit(shutdown_command(folder, rig, json_file))


@fidim.command()
@click.argument("rig", type=FILE)
@seed_option("Random seed of the robot's true parameters and of all noise.")
@hide_option("Add this effect to the simulation; the model does not have it.")
@click.option("--plan", type=FILE, help="Begin at rest, with the cable lengths of this plan's first window.")
@click.option("--ports", metavar="BUS,MOCAP,HAND", help="Ports of 127.0.0.1 to use instead of those of the rig file.")
@click.option("--no-load", is_flag=True, help="Simulate drums without the platform, for fidim commission.")
@click.option("--until-input-ends", is_flag=True, hidden=True)
@example("fidim simulators examples/rigs/simulated.toml")
def simulators(**options: Any) -> None:
    """Simulate the devices of the RIG file for other processes, in real time, until Ctrl-C.

    It simulates the drives on the rig's bus, motion capture on its socket, and a hand that answers prompts. A typed
    line causes a failure: bus, mocap, drive K (loses power), fault K, off K (switched off over the bus). "drive K
    again" undoes it.
    """
    from fidim_lab.app.session.simulators import SimulatorOptions, simulators_command

    sys.exit(simulators_command(SimulatorOptions(**options)))


@fidim.command()
@click.argument("rig", type=FILE)
@click.option(
    "--by",
    default="",
    metavar="NAME",
    help="Who is at the robot; faults are acknowledged in this name. Required except with --list.",
)
@click.option("--out", type=OUT_FOLDER, help="Run folder; default: runs/commission-RIG.")
@LISTING
@EMBEDDED
@seed_option("With --embedded: random seed of the simulation.")
@answer_option("fidim-summary/1")
@example('fidim commission rig.toml --by "A. Name"')
def commission(**options: Any) -> None:
    """Prove by trial that each drive of the RIG file stops: without load, at low speed, with somebody present.

    Trials: quick stop, halt, heartbeat withheld, SYNC withheld, position limit, following error. Time and distance are
    measured by the drive's own encoder. A passed trial is kept in RIG.proofs.toml and counts for this drive with these
    settings; one of a rehearsal is kept in RIG.rehearsal-proofs.toml and counts only in rehearsals.
    """
    if not options["embedded"]:
        only_with("--embedded", "seed")
    from fidim_lab.app.session.commission import CommissionOptions, commission_command

    sys.exit(commission_command(CommissionOptions(**options)))


@fidim.command("power-off")
@click.argument("rig", type=FILE)
@YES
@click.option(
    "--acknowledge", "acknowledged_by", metavar="NAME", help="Also reset faults; NAME has checked their cause."
)
@answer_option("fidim-power-off/1", FILE)  # likewise
@example("fidim power-off rig.toml")
def power_off(**options: Any) -> None:
    """Switch off all drives of the RIG file, for example after a run whose program has ended.

    Drives that lost their host hold the load in quick stop. A new run refuses them until they are switched off.
    """
    from fidim_lab.app.session.power_off import PowerOffOptions, power_off_command

    sys.exit(power_off_command(PowerOffOptions(**options)))


@fidim.command()
@click.argument("rig", type=FILE)
@click.argument("winch")
@click.option("--release/--apply", required=True, help="Release the drum so that it can turn, or hold it again.")
@YES
@answer_option("fidim-brake/1")
@example('fidim brake rig.toml "winch 2" --release')
def brake(**options: Any) -> None:
    """Release or apply the holding brake of one WINCH of the RIG file, for mounting; the drive must be without power.

    The rig file names the brake's output (brake_output, a bit of object 60FE). In operation the drive controls it.
    """
    from fidim_lab.app.session.brake import BrakeOptions, brake_command

    sys.exit(brake_command(BrakeOptions(**options)))


@fidim.command()
@click.option("--robot", type=ROBOT, help="Also check this robot file for plausibility.")
@click.option("--rig", type=FILE, help="Also check the hardware of this rig file; it is only read, nothing moves.")
@click.option(
    "--picture", type=OUT_FILE, help="With --robot: write a drawing of the robot with all its symbols to this SVG file."
)
@click.option("--eds", type=FILE, help="Show what the drive of this EDS or DCF file can do.")
@click.option("--family", help="With --eds: a built-in drive family, or a file of your own (.toml).")
@answer_option("fidim-doctor/1")
@example("fidim doctor --rig rig.toml")
def doctor(
    robot: Path | None,
    rig: Path | None,
    picture: Path | None,
    eds: Path | None,
    family: str | None,
    json_file: Path | None,
) -> None:
    """Check installation, buses, sockets, clock and disk, and say what to do about each failure.

    With --rig it also checks each drive against the rig file (wanted, found), motion capture, guards and the robot
    file; exit code 1 if a check failed, 3 if something cannot be reached. With --eds it only grades one drive by its
    file, before anything is connected, and lists what had to be repaired in that file.
    """
    from fidim_lab.app.doctor.command import UnconnectedDrive, doctor_command

    if family is not None and eds is None:
        raise click.UsageError("--family needs --eds.")
    if picture is not None and robot is None:
        raise click.UsageError("--picture needs --robot.")
    sys.exit(doctor_command(robot, json_file, rig, None if eds is None else UnconnectedDrive(eds, family), picture))


@fidim.command("tension-calibrate")
@click.argument("campaign", type=FOLDER)
@answer_option("fidim-tension-calibration/1")
@example("fidim tension-calibrate runs/poses")
def tension_calibrate(campaign: Path, json_file: Path | None) -> None:
    """Find gain, offset and friction band of each winch from the rest poses of CAMPAIGN; prints lines for the rig file.

    Motor currents are fitted to the tensions that statics gives for the held cable lengths, with mass and geometry of
    the robot file. Exit code 1 if the tensions differ too little for a fit.
    """
    from fidim_lab.app.session.tension_calibrate import tension_calibrate_command

    sys.exit(tension_calibrate_command(campaign, json_file))


@fidim.command()
@click.argument("kind", type=click.Choice(["robot", "rig", "plan", "campaign"]))
@click.option("--out", type=OUT_EITHER, help="File to write (for a campaign: the folder); default KIND.toml.")
@click.option("--robot", type=ROBOT, help="Robot that the new file is for; default robot.toml.")
@click.option("--cables", default=4, show_default=True, type=int, help="Number of cables of a new robot, 2 to 5.")
@click.option("--simulated", is_flag=True, help="For a rig: use the devices of fidim simulators instead of hardware.")
@answer_option("fidim-init/1")
@example("fidim init robot --cables 3\n      fidim init rig --simulated\n      fidim init plan --robot robot.toml")
def init(**options: Any) -> None:
    """Write a new file of KIND: every key with its unit, its frame and how it is measured. Overwrites nothing.

    KIND: robot, rig, plan, or campaign (a folder). The numbers are those of a plausible robot, which works on
    simulators at once; replace them by yours.
    """
    kind = options["kind"]
    not_with(kind, "robot" if kind == "robot" else "cables")
    if kind != "rig":
        only_with("rig", "simulated")
    from fidim_lab.app.starters.command import InitOptions, init_command

    sys.exit(init_command(InitOptions(**options)))
