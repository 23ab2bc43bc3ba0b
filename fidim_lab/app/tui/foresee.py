"""A worker: on each line of standard input a recording so far, on standard output the model's prediction of it.

The initial state is fitted to the first seconds, with the body of the run's result, or of CAD where there is none yet;
from there the model runs on, so that later samples can be held against it. Most of the time goes into making the
model's functions, so one `Seer` keeps them, and a request without samples makes them ahead of the first recording.
"""

import json
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np

from fidim_lab.app.terminal.worker_pipe import requests
from fidim_lab.app.tui.foresight import FIRST, MOST
from fidim_lab.data.campaign import ROBOT
from fidim_lab.data.plan_file import read_plan
from fidim_lab.data.records import Body, Campaign, Pose, Robot, Role, Window
from fidim_lab.data.robot_file import read_robot
from fidim_lab.errors import FidimError
from fidim_lab.identification.motion.measured import measure
from fidim_lab.identification.motion.recipe import Recipe
from fidim_lab.identification.motion.trajectory import predict
from fidim_lab.identification.results.result_file import read_result
from fidim_lab.model.equilibria import pose_from_lengths
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion import consistent_twist, simulate_free_motion

REACH = 30.0
"""s that are predicted, from the window's beginning: always as many, so that the functions for it are made once"""
STEP = 0.02
"""s between predicted points"""
PLAN = "plan.toml"
RATE = 100.0
"""Hz of the swing with which the model's functions are made"""


class Seer:
    """Answers requests about one robot after the other; keeps what was made for the present one."""

    def __init__(self) -> None:
        self._known: tuple[Path, int, Mechanism] | None = None

    def answer(self, request: dict[str, Any]) -> dict[str, Any]:
        """`t`, `positions` (of the main marker), `fitted` (s), `body`; or `doubt`, why there is none.

        A request without `t` only makes ready; it is answered by `ready`.
        """
        folder = Path(request["folder"])
        try:
            mechanism = self._mechanism(folder / ROBOT)
            if "t" not in request:
                return {"ready": _rehearse(mechanism, folder / PLAN)}
            body, whose = _body(folder, mechanism.robot)
            found: dict[str, Any] = {"doubt": "nothing was recorded"}
            for seconds in (MOST, FIRST):
                found = _predicted(mechanism, body, _window(request, mechanism.robot, seconds))
                if "doubt" not in found:
                    break
            return found if "doubt" in found else {**found, "body": whose}
        except FidimError as error:
            return {"doubt": str(error).splitlines()[0]}

    def _mechanism(self, path: Path) -> Mechanism:
        changed = path.stat().st_mtime_ns if path.exists() else 0
        if self._known is None or self._known[:2] != (path, changed):
            self._known = (path, changed, Mechanism(read_robot(path)))
        return self._known[2]


def _rehearse(mechanism: Mechanism, plan: Path) -> bool:
    """Predict a small swing about the plan's first equilibrium; whether that went well."""
    try:
        lengths = read_plan(plan, mechanism.n).windows[0].lengths
        body = mechanism.robot.nominal
        rest = pose_from_lengths(mechanism, body, lengths).pose
        twist = consistent_twist(mechanism, body, rest, np.array([0.05, 0.05, 0.0, 0.0, 0.0, 0.0]))
        swing = simulate_free_motion(mechanism, body, rest, twist, np.arange(0.0, MOST, 1.0 / RATE)).motion
        seen = swing.positions + np.einsum("nij,j->ni", swing.rotations, mechanism.robot.markers[0])
        held = np.tile(lengths, (len(seen), 1))
        parts = (slice(round(seconds * RATE)) for seconds in (FIRST, MOST))
        swings = [
            Window("rehearsal", Role.IDENTIFY, swing.t[part], seen[part, None], held[part], None) for part in parts
        ]
        return all("doubt" not in _predicted(mechanism, body, window) for window in swings)
    except FidimError:
        return False  # the recording itself will say what is wrong


def _body(folder: Path, robot: Robot) -> tuple[Body, str]:
    file = folder / "result.json"
    return (read_result(file).body, "result") if file.exists() else (robot.nominal, "CAD")


def _window(request: dict[str, Any], robot: Robot, seconds: float) -> Window:
    """The beginning of the recording."""
    seen = np.array([p or [np.nan] * 3 for p in request["positions"]], dtype=float)
    markers = np.full((len(seen), len(robot.markers), 3), np.nan)
    markers[:, 0] = seen
    lengths = np.array([[np.nan if v is None else v for v in row] for row in request["lengths"]], dtype=float)
    t = np.array(request["t"], dtype=float)
    use = t <= t[0] + seconds
    return Window(request["window"], Role.IDENTIFY, t[use], markers[use, :1], lengths[use], None)


def _predicted(mechanism: Mechanism, body: Body, window: Window) -> dict[str, Any]:
    robot = mechanism.robot
    rate = 1.0 / float(np.median(np.diff(window.t)))
    measured = measure(mechanism, Campaign("live", robot, rate, (window,)), window, Recipe())
    found = predict(mechanism, body, measured)
    if found is None:
        return {"doubt": "the model cannot follow this motion"}
    motion = found.motion
    times = motion.t[0] + np.arange(0.0, REACH, STEP)
    pose = Pose(motion.positions[0], motion.rotations[0])
    ahead = simulate_free_motion(mechanism, body, pose, motion.twists[0], times).motion
    paths = ahead.positions + np.einsum("nij,j->ni", ahead.rotations, robot.markers[0])
    return {
        "t": [round(float(t), 4) for t in ahead.t],
        "positions": [[round(float(v), 6) for v in row] for row in paths],
        "fitted": window.duration,
    }


def main() -> None:
    """One answer a line, until standard input ends: with the UI, however that ended."""
    os.nice(10)
    seer = Seer()
    for text in requests():
        sys.stdout.write(json.dumps(seer.answer(json.loads(text))) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
