"""Commands of a session at the robot, real or simulated.

Modules are imported when their command runs: `fidim --help` stays quick.
"""

import sys
from pathlib import Path
from typing import Any

import click

from fidim_lab.app.cli.completion import hide_option
from fidim_lab.app.cli.outputs import OUT_EITHER, OUT_FILE, OUT_FOLDER
from fidim_lab.app.cli.root import FILE, FOLDER, ROBOT, Number, example, fidim, not_with, only_with


@fidim.command("dry-run")
@click.option(
    "--out", type=OUT_FOLDER, default=None, help="Run folder; default runs/dry-run-SEED, numbered if it exists."
)
@click.option(
    "--seed", default=1, show_default=True, type=click.IntRange(0), help="Same seed, same windows, byte for byte."
)
@click.option("--robot", type=ROBOT, default=None, help="Robot file; default the paper's four-cable robot.")
@click.option("--equilibria", default=12, show_default=True, type=click.IntRange(1, 60))
@click.option(
    "--validate", "validation", default=3, show_default=True, type=click.IntRange(0, 60), help="Held-out windows."
)
@click.option("--plan", type=FILE, default=None, help="Windows to rehearse, as they are; no random ones.")
@click.option(
    "--excite", is_flag=True, help="No hand: the winches excite, calm and travel (fidim run --procedure excite)."
)
@hide_option("Hide physics in the simulated world.")
@click.option("--real-time", is_flag=True, help="Real python-can bus, real UDP sockets, real seconds.")
@click.option("--ui", is_flag=True, help="In real time, from the terminal UI: started, answered, stopped by keys.")
@click.option("--light", is_flag=True, help="The UI dark on light.")
@click.option("--json", "json_file", type=OUT_FILE, default=None, help="Write the result for programs.")
@example("fidim dry-run --seed 7 --hide air-drag-linear:c=0.4")
def dry_run(**options: Any) -> None:
    """Rehearse the whole experiment on the embedded simulators, through the drivers' real bytes."""
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
@click.option("--out", type=OUT_FOLDER, default=None, help="Run folder; default runs/PLAN, numbered if it exists.")
@click.option(
    "--procedure",
    default="identify",
    show_default=True,
    metavar="NAME|FILE.py",
    help="Built-in, or your own: docs/procedures.md.",
)
@click.option("--list", "listing", is_flag=True, help="Print the steps and their times; nothing is opened.")
@click.option("--embedded", is_flag=True, help="Rehearse in real time on simulated devices in a child process.")
@click.option("--seed", default=1, show_default=True, type=click.IntRange(0), help="Of an embedded world.")
@hide_option("Hide physics in an embedded world.")
@click.option("--set", "settings", multiple=True, metavar="TABLE.KEY=NUMBER", help="Change a setting of the procedure.")
@click.option("--unattended", is_flag=True, help="Refuse to start where a prompt has no stated answer.")
@click.option(
    "--answer", "answers", multiple=True, metavar="KIND=CHOICE[@S]", help="Answer a kind of prompt, after S s."
)
@click.option("--max-hours", type=Number(0, min_open=True), default=None, help="End, held, after so long.")
@click.option("--quiet-hours", default=None, metavar="HH:MM-HH:MM", help="No window begins between them.")
@click.option("--on-finish", default="", metavar="COMMAND", help="Run after a run that ended well.")
@click.option("--on-fault", default="", metavar="COMMAND", help="Run after a run that did not.")
@click.option("--operator", default=None, metavar="NAME", help="Who records, for fidim ls; default your user name.")
@click.option("--note", default="", metavar="TEXT", help="What is to be remembered of this run, for fidim ls.")
@click.option("--stay", is_flag=True, help="The service goes on after the run, until fidim shutdown.")
@click.option("--tcp", type=click.IntRange(0, 65535), default=None, help="Also listen at 127.0.0.1, with a token.")
@click.option("--json", "json_file", type=OUT_FILE, default=None, help='Write "fidim-summary/1".')
@example("fidim run plan.toml --rig examples/rigs/simulated.toml --embedded")
def run_(**options: Any) -> None:
    """Run PLAN on a rig: a service in its own process owns the robot, this terminal watches and answers prompts.

    Ctrl-C aborts, with the robot held. The terminal may be closed: the run goes on, and prompts wait for a client.
    """
    if not options["embedded"]:  # only simulated devices hide something
        only_with("--embedded", "hide", "seed")
    from fidim_lab.app.session.run import RunOptions, run_command

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
    if not options["web"]:
        only_with("--web", "port")
    from fidim_lab.app.session.ui import UiOptions, ui_command

    sys.exit(ui_command(UiOptions(**options)))


@fidim.command()
@click.argument("folder", type=FOLDER)
@click.option("--accept-place", is_flag=True, help="Go on from wherever the robot is: you have looked, or homed it.")
@click.option("--trust", is_flag=True, help="Carry out commands and files that run.json names without a question.")
@click.option("--json", "json_file", type=OUT_FILE, default=None, help='Write "fidim-summary/1".')
@example("fidim resume runs/plan")
def resume(**options: Any) -> None:
    """Go on with the run in FOLDER after an emergency stop, a crash, a kill, a power cut or an abort.

    Windows that have their verdict stay; the open one is recorded again. Nothing moves where the robot is not where the
    journal left it. A latched emergency stop is undone by two answers, "yes" to each.
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
@click.option("--rig", type=FILE, default=None, help="Only the service of this rig; default all of yours.")
@click.option("--reason", default="", help="For the journal.")
@click.option("--json", "json_file", type=FILE, default=None, help='Write "fidim-stop/1".')  # a stop waits for no path
@example("fidim stop")
def stop(rig: Path | None, reason: str, json_file: Path | None, not_understood: str) -> None:
    """Emergency stop: quick-stop all winches now, latched. Not a substitute for the hardware button.

    Whatever else is typed, it stops all of yours.
    """
    from fidim_lab.app.session.stop import stop_command

    sys.exit(stop_command(rig, reason, not_understood, json_file))


@fidim.command()
@click.argument("folder", type=FOLDER, required=False)
@click.option("--rig", type=FILE, default=None, help="Of this rig, instead of that of FOLDER's run.")
@click.option("--json", "json_file", type=OUT_FILE, default=None, help='Write "fidim-reset/1".')
@example("fidim reset --rig rig.toml")
def reset(folder: Path | None, rig: Path | None, json_file: Path | None) -> None:
    """Undo an emergency stop, by two answers: the cause has gone, nobody is at the cables. Nothing moves yet.

    The stop is kept beside the rig file, whether or not a service runs; fidim run and fidim resume ask the same.
    """
    from fidim_lab.app.session.undo_stop import reset_command

    sys.exit(reset_command(folder, rig, json_file))


@fidim.command()
@click.argument("folder", type=FOLDER, required=False)
@click.option("--rig", type=FILE, default=None, help="The service of this rig.")
@click.option("--json", "json_file", type=OUT_FILE, default=None, help='Write "fidim-shutdown/1".')
@example("fidim shutdown")
def shutdown(folder: Path | None, rig: Path | None, json_file: Path | None) -> None:
    """End a service whose run has ended (fidim run --stay) or has not begun; a run that goes on is left alone."""
    from fidim_lab.app.session.shutdown import shutdown_command

    sys.exit(shutdown_command(folder, rig, json_file))


@fidim.command()
@click.argument("rig", type=FILE)
@click.option("--seed", default=1, show_default=True, type=click.IntRange(0), help="Of the true robot and all noise.")
@hide_option("Hide physics in the simulated world.")
@click.option("--plan", type=FILE, default=None, help="Begin at rest at the first lengths of this plan.")
@click.option("--ports", default=None, metavar="BUS,MOCAP,HAND", help="Of 127.0.0.1, instead of what the rig names.")
@click.option("--no-load", is_flag=True, help="No cable carries the platform: for fidim commission.")
@click.option("--until-input-ends", is_flag=True, hidden=True)
@example("fidim simulators examples/rigs/simulated.toml")
def simulators(**options: Any) -> None:
    """Simulate the devices of the RIG file for other processes, in real time, until Ctrl-C.

    Drives on its bus, motion capture at its socket, and a hand that answers prompts. A line typed here pulls a plug:
    bus, mocap, drive K (loses power), fault K, off K (switched off over the bus). "drive K again" puts it back.
    """
    from fidim_lab.app.session.simulators import SimulatorOptions, simulators_command

    sys.exit(simulators_command(SimulatorOptions(**options)))


@fidim.command()
@click.argument("rig", type=FILE)
@click.option(
    "--by",
    default="",
    metavar="NAME",
    help="Who is at the robot; faults are acknowledged in this name. Only --list does without.",
)
@click.option("--out", type=OUT_FOLDER, default=None, help="Run folder; default runs/commission-RIG.")
@click.option("--list", "listing", is_flag=True, help="Print the steps and their times; nothing is opened.")
@click.option("--embedded", is_flag=True, help="Rehearse in real time on simulated devices in a child process.")
@click.option("--seed", default=1, show_default=True, type=click.IntRange(0), help="Of an embedded world.")
@click.option("--json", "json_file", type=OUT_FILE, default=None, help='Write "fidim-summary/1".')
@example('fidim commission rig.toml --by "A. Name"')
def commission(**options: Any) -> None:
    """Prove the stops of each drive of the RIG file by trial: without load, at low speed, with somebody there.

    Quick stop, halt, heartbeat withheld, SYNC withheld, position limit, following error; time and way by the drive's
    own encoder. What passes is kept in RIG.proofs.toml, for this drive and these settings;
    of a rehearsal in RIG.rehearsal-proofs.toml, for rehearsals.
    """
    if not options["embedded"]:
        only_with("--embedded", "seed")
    from fidim_lab.app.session.commission import CommissionOptions, commission_command

    sys.exit(commission_command(CommissionOptions(**options)))


@fidim.command("power-off")
@click.argument("rig", type=FILE)
@click.option("--yes", is_flag=True, help="The load is secured; do not ask.")
@click.option(
    "--acknowledge", "acknowledged_by", default=None, metavar="NAME", help="Reset faults; NAME saw the cause."
)
@click.option("--json", "json_file", type=FILE, default=None, help='Write "fidim-power-off/1".')  # likewise
@example("fidim power-off rig.toml")
def power_off(**options: Any) -> None:
    """Take the power from all drives of the RIG file, as after a run whose program has ended.

    Drives that lost their host hold the load in quick stop, and no other session takes them over until this is done.
    """
    from fidim_lab.app.session.power_off import PowerOffOptions, power_off_command

    sys.exit(power_off_command(PowerOffOptions(**options)))


@fidim.command()
@click.argument("rig", type=FILE)
@click.argument("winch")
@click.option("--release/--apply", required=True, help="Let the drum turn, or hold it again.")
@click.option("--yes", is_flag=True, help="The load is secured; do not ask.")
@click.option("--json", "json_file", type=OUT_FILE, default=None, help='Write "fidim-brake/1".')
@example('fidim brake rig.toml "winch 2" --release')
def brake(**options: Any) -> None:
    """Release the holding brake of a WINCH of the RIG file by hand, without power, for mounting; or apply it.

    Its output is named in the rig file (brake_output, a bit of 60FE). In operation a brake is the drive's own matter.
    """
    from fidim_lab.app.session.brake import BrakeOptions, brake_command

    sys.exit(brake_command(BrakeOptions(**options)))


@fidim.command()
@click.option("--robot", type=ROBOT, default=None, help="Also check this robot file for plausibility.")
@click.option("--rig", type=FILE, default=None, help="Also check this rig file's hardware; only reads, moves nothing.")
@click.option("--picture", type=OUT_FILE, default=None, help="SVG file for a drawing of --robot with all its symbols.")
@click.option("--eds", type=FILE, default=None, help="Tell what the drive of this EDS or DCF file can do.")
@click.option("--family", default=None, help="Of --eds: a built-in drive family, or a file of your own (.toml).")
@click.option("--json", "json_file", type=OUT_FILE, default=None, help='Write "fidim-doctor/1".')
@example("fidim doctor --rig rig.toml")
def doctor(
    robot: Path | None,
    rig: Path | None,
    picture: Path | None,
    eds: Path | None,
    family: str | None,
    json_file: Path | None,
) -> None:
    """Check installation, buses, sockets, clock and disk, and say what to do where one fails.

    With --rig also each drive against the rig file (wanted, found), motion capture, guards and the robot file: exit 1
    where a check failed, 3 where something cannot be reached. With --eds only the grade table of one drive, before
    anything is connected, and what had to be repaired in its file.
    """
    from fidim_lab.app.doctor.command import UnconnectedDrive, doctor_command

    if family is not None and eds is None:
        raise click.UsageError("--family belongs to --eds.")
    if picture is not None and robot is None:
        raise click.UsageError("--picture goes with --robot.")
    sys.exit(doctor_command(robot, json_file, rig, None if eds is None else UnconnectedDrive(eds, family), picture))


@fidim.command("tension-calibrate")
@click.argument("campaign", type=FOLDER)
@click.option("--json", "json_file", type=OUT_FILE, default=None, help='Write "fidim-tension-calibration/1".')
@example("fidim tension-calibrate runs/poses")
def tension_calibrate(campaign: Path, json_file: Path | None) -> None:
    """Gain, offset and friction band of each winch from the rests of CAMPAIGN, as lines for the rig file.

    Motor currents are fitted on the tensions that statics give for the held cable lengths; mass and geometry are taken
    from the robot file. Exit 1 where the tensions differ too little to tell.
    """
    from fidim_lab.app.session.tension_calibrate import tension_calibrate_command

    sys.exit(tension_calibrate_command(campaign, json_file))


@fidim.command()
@click.argument("kind", type=click.Choice(["robot", "rig", "plan", "campaign"]))
@click.option("--out", type=OUT_EITHER, default=None, help="File, of a campaign the folder; default KIND.toml.")
@click.option("--robot", type=ROBOT, default=None, help="That the file is for; default robot.toml.")
@click.option("--cables", default=4, show_default=True, type=int, help="Of a new robot: 2 to 5.")
@click.option("--simulated", is_flag=True, help="rig: for the devices of fidim simulators, not for hardware.")
@click.option("--json", "json_file", type=OUT_FILE, default=None, help='Write "fidim-init/1".')
@example("fidim init robot --cables 3\n      fidim init rig --simulated\n      fidim init plan --robot robot.toml")
def init(**options: Any) -> None:
    """Write a new file of KIND: every key with its unit, its frame and how it is measured. Overwrites nothing.

    KIND: robot, rig, plan, or campaign (a folder). The numbers are those of a plausible robot, so that it can be tried
    on simulators at once; replace them by yours.
    """
    kind = options["kind"]
    not_with(kind, "robot" if kind == "robot" else "cables")
    if kind != "rig":
        only_with("rig", "simulated")
    from fidim_lab.app.starters.command import InitOptions, init_command

    sys.exit(init_command(InitOptions(**options)))
