"""`fidim dry-run --ui`: the embedded laboratory in a service of its own, in real time, with the terminal UI attached.

All is as in a real session: the emergency stop begins latched, the run begins at a key, prompts wait for one. The
simulated hand does what a prompt asks once somebody has answered it.
"""

import asyncio
import subprocess
import tempfile
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import tomli_w

from fidim_lab.app import compose
from fidim_lab.app.analysis.possible_robot import require_possible
from fidim_lab.app.formats.run_spec import RunSpec
from fidim_lab.app.service.client import ServiceGoneError, connect
from fidim_lab.app.service.commands import Shutdown, TakeLease
from fidim_lab.app.service.lock import holder, in_use
from fidim_lab.app.service.main import prepare
from fidim_lab.app.service.own_process import service_process, until_it_listens
from fidim_lab.app.service.place import ServicePlace, place_of
from fidim_lab.app.session.dry_run_plan import DryRunOptions, planned
from fidim_lab.app.session.ui import need_terminal, run_ui
from fidim_lab.app.terminal import console
from fidim_lab.app.terminal.working import Working
from fidim_lab.app.tui.link import Finder
from fidim_lab.data.plan_file import write_plan
from fidim_lab.data.records import Robot
from fidim_lab.data.robot_file import PAPERS_ROBOT, read_robot, write_robot
from fidim_lab.errors import SetupError
from procedures.recording.run_folder import require_new

BUS = {"interface": "slcan", "channel": "socket://127.0.0.1:1", "bitrate": 1_000_000, "sync_rate": 100.0}
"""never opened: an embedded service simulates the bus"""
EVERY_WINCH = {
    "eds": "generic",
    "counts_per_turn": 4096.0,
    "rated_current": 5.0,
    "current_limit": 12.0,
    "length_limits": [0.2, 6.0],
    "max_speed": 0.5,
    "max_acceleration": 1.0,
    "heartbeat": 0.3,
    "host_timeout": 1.5,
    "sdo_timeout": 3.0,
}
END_WITHIN = 10.0
"""s for a service to end that nobody has started"""


def run_ui_dry_run(options: DryRunOptions, folder: Path) -> int:
    """Plan, start the service, attach; returns 0 when the person has left. Raises FidimError before anything opens."""
    require_new(folder)
    with tempfile.TemporaryDirectory(prefix="fidim-ui-") as inputs:
        with Working("planning equilibria with room to swing", options.equilibria + options.validation):
            spec = make_spec(options, folder, Path(inputs))
            need_terminal("fidim dry-run without --ui")
            work = prepare(spec)
        place = place_of(work.file, embedded=True, run=spec.own_place)
        if (other := holder(place)) is not None:
            raise SetupError(in_use(other))
        with service_process(spec, place) as process:
            asyncio.run(until_it_listens(place, process))
            run_ui(Finder(folder=folder), folder, light=options.light)
            return _leave(place, process, folder)


def make_spec(options: DryRunOptions, folder: Path, inputs: Path) -> RunSpec:
    """What the service is to run, its files in `inputs`. Raises SetupError for an effect that nobody knows."""
    robot = with_winches(read_robot(options.robot or PAPERS_ROBOT))
    if options.robot is not None:
        require_possible(options.robot, robot)
    compose.simulated_world(robot, options.seed, options.hide)  # an effect that nobody knows is said before planning
    plan = planned(options, robot)
    write_plan(inputs / "plan.toml", plan)
    write_robot(inputs / "robot.toml", robot)
    (inputs / "rig.toml").write_text(tomli_w.dumps(rig_table(robot)), encoding="utf-8")
    return RunSpec(
        plan=inputs / "plan.toml",
        rig=inputs / "rig.toml",
        out=folder.absolute(),
        procedure="excite" if options.excite else "identify",
        embedded=True,
        dry_run=True,
        seed=options.seed,
        hide=options.hide,
    )


def with_winches(robot: Robot) -> Robot:
    """The robot, with winches like those of the paper's where its file has none: a rehearsal needs some."""
    if robot.winches is not None:
        return robot
    like = read_robot(PAPERS_ROBOT).winches or ()
    return replace(robot, winches=like[:1] * robot.n)


def rig_table(robot: Robot) -> dict[str, object]:
    """A rig file for embedded simulators of this robot, which has winches."""
    winches = [
        {
            "name": f"winch {k + 1}",
            "node_id": k + 1,
            "direction": 1,
            "home_length": 1.5,
            "gear_ratio": winch.gear_ratio,
            "drum_radius": winch.drum_radius,
        }
        for k, winch in enumerate(robot.winches or ())
    ]
    return {
        "format": "fidim-rig/1",
        "name": "embedded simulators",
        "robot": "robot.toml",
        "bus": BUS,
        "every_winch": EVERY_WINCH,
        "winch": winches,
        "motion_capture": {
            "kind": "vicon-udp",
            "host": "127.0.0.1",
            "port": 1,
            "rate": 100.0,
            "markers": [f"marker{k + 1}" for k in range(len(robot.markers))],
        },
    }


def _leave(place: ServicePlace, process: "subprocess.Popen[bytes]", folder: Path) -> int:
    """A service that does nothing ends; one that runs goes on, and it is said how to come back."""
    if process.poll() is None and asyncio.run(_shut_down(place)):
        with suppress(subprocess.TimeoutExpired):
            process.wait(timeout=END_WITHIN)
    if process.poll() is None:
        console.out.print(f"The run continues. fidim ui {folder} attaches again, fidim stop stops it.", markup=False)
    elif folder.exists():
        console.out.print(f"run folder  {folder}", markup=False)
    return 0


async def _shut_down(place: ServicePlace) -> bool:
    with suppress(SetupError, ServiceGoneError):
        async with connect(place.socket, name="fidim dry-run", samples=False) as service:
            await service.command(TakeLease(force=True))
            return (await service.command(Shutdown())).ok
    return False
