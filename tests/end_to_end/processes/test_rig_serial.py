"""A rig with serial devices, its simulators in another process: doctor, a run, and plugs pulled in the middle."""

import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fidim_lab.app import cli, compose
from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.plan_file import write_plan
from fidim_lab.data.records import Plan, PlannedWindow, Role
from fidim_lab.data.rigs.rig_file import read_rig
from procedures.events import StepStarted, Warned
from procedures.protocols import catalogue
from procedures.run import run_procedure
from procedures.settings import HandSettings, MotionSettings, RecordSettings, Settings, TensionSettings

pytestmark = pytest.mark.slow
MAIN = "from fidim_lab.app.cli import main; main()"
EXAMPLE = Path(__file__).parents[3] / "examples" / "rigs" / "simulated-serial.toml"
SETTINGS = Settings(
    motion=MotionSettings(settle_over=0.5),
    tension=TensionSettings(over=0.3),
    hand=HandSettings(over=0.3),
    record=RecordSettings(seconds=2.0, longest_gap=1.0, complete=0.8),
)
PLAN = Plan(
    "one window",
    (
        PlannedWindow(
            "i01",
            Role.IDENTIFY,
            np.array((1.30283, 1.39119, 1.52772, 1.41231)),
            np.array([-0.02, 0.03]),
            np.array((1.111, -0.271, -0.315)),
        ),
    ),
)


def free_port(kind=socket.SOCK_STREAM):
    with socket.socket(socket.AF_INET, kind) as taken:
        taken.bind(("127.0.0.1", 0))
        return taken.getsockname()[1]


@contextlib.contextmanager
def simulators(folder, change=lambda text: text):
    """`fidim simulators` as a child, on ports of its own; yields the rig file and how to pull its plugs."""
    text = change(EXAMPLE.read_text()).replace("/tmp/fidim-lab/", f"{folder}/")
    for ours, kind in ((20110, socket.SOCK_STREAM), (20111, socket.SOCK_DGRAM), (20112, socket.SOCK_STREAM)):
        text = text.replace(str(ours), str(free_port(kind)))
    rig, plan = folder / "rig.toml", folder / "plan.toml"
    rig.write_text(text)
    write_plan(plan, PLAN)
    child = subprocess.Popen(
        [sys.executable, "-c", MAIN, "simulators", str(rig), "--plan", str(plan)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        bufsize=1,
        start_new_session=True,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    )
    said = []
    for line in child.stdout:
        said.append(line)
        if line.startswith("ready"):
            break
    else:
        pytest.fail(f"the simulators did not start: {said}")
    try:
        yield rig, lambda plug: child.stdin.write(f"{plug}\n")
        child.send_signal(signal.SIGINT)
        rest, _ = child.communicate(timeout=20)
        assert (child.returncode, "Traceback" in rest) == (0, False), rest
    finally:
        if child.poll() is None:
            child.kill()
            child.communicate(timeout=10)


def run(rig, folder, at=None, pull=lambda: None):
    """A run of the plan; `pull` is called when a step of the type named `at` begins. Returns report and events."""
    file = read_rig(rig)
    settings = compose.rig_settings(file, SETTINGS)
    settings = replace(settings, release=replace(settings.release, by_hand=settings.release.by_hand, over=0.3))
    experiment = catalogue.experiment("identify", PLAN, file.robot, settings)
    events = []

    def listen(event):
        if isinstance(event, StepStarted) and type(event.step).__name__ == at:
            pull()
        events.append(event)

    async def main():
        async with compose.real_rig(file) as real:
            return await run_procedure(experiment, real.rig, folder, wall_time=lambda: "now", listeners=(listen,))

    return compose.run_loop(main(), real_time=True), events


def test_doctor_is_green_and_a_run_is_let_go_by_the_release(tmp_path, capsys):
    with simulators(tmp_path) as (rig, _):
        told = tmp_path / "doctor.json"
        assert cli.run(["doctor", "--rig", str(rig), "--json", str(told)]) == 0, capsys.readouterr().out
        checks = {(check["device"], check["name"]): check for check in json.loads(told.read_text())["checks"]}
        assert checks["release", "state"]["found"] == "released"
        assert "f3" in checks["load cells", "readings"]["found"]
        assert checks["inclinometer", "rate"]["wanted"] == "10 Hz"
        report, events = run(rig, tmp_path / "run")
    assert report.exit_code == 0, report.reason
    steps = [type(event.step).__name__ for event in events if isinstance(event, StepStarted)]
    assert steps.index("AwaitHeld") < steps.index("Record")
    (window,) = read_campaign(tmp_path / "run").windows
    assert set(window.further) == {"f1", "f2", "f3", "f4", "incl_x", "incl_y"}
    cells = np.column_stack([window.further[f"f{k}"] for k in range(1, 5)])
    assert np.isfinite(cells).mean() > 0.9
    factors = [winch.newton_per_ampere for winch in read_rig(rig).robot.winches]
    by_current = np.nanmean(window.currents * np.array(factors), axis=0)
    assert np.nanmean(cells, axis=0) == pytest.approx(by_current, abs=10.0)


def test_a_release_that_fetches_the_platform_asks_nobody_to_displace(tmp_path):
    with simulators(tmp_path, lambda text: text.replace('"by-hand" ', '"by-itself" ')) as (rig, _):
        report, events = run(rig, tmp_path / "run")
    assert report.exit_code == 0, report.reason
    asked = [event.step for event in events if isinstance(event, StepStarted) and type(event.step).__name__ == "Ask"]
    assert asked == []


def test_a_release_unplugged_while_it_holds_ends_the_run_held(tmp_path):
    with simulators(tmp_path) as (rig, pull):
        report, _ = run(rig, tmp_path / "run", "AwaitHeld", lambda: pull("serial 1"))
    assert report.exit_code == 3
    assert "release" in report.reason
    assert "unplugged" in report.reason or "does not hold" in report.reason
    assert report.held


def test_load_cells_unplugged_while_recording_are_told_of_and_left_blank(tmp_path):
    with simulators(tmp_path) as (rig, pull):
        report, events = run(rig, tmp_path / "run", "Record", lambda: pull("serial 2"))
        assert cli.run(["doctor", "--rig", str(rig)]) != 0
    assert report.exit_code == 0, report.reason
    assert any("load cells" in event.trip.says for event in events if isinstance(event, Warned))
