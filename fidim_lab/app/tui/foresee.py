"""A worker: on each line of standard input a recording so far, on standard output the model's prediction of it.

The initial state is fitted to what there is, with the body of the run's result, or of CAD where there is none yet; from
there the model runs on for as long again, and some seconds more, so that later samples can be held against it.
"""

import json
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np

from fidim_lab.data.campaign import ROBOT
from fidim_lab.data.records import Body, Campaign, Pose, Robot, Role, Window
from fidim_lab.data.robot_file import read_robot
from fidim_lab.errors import FidimError
from fidim_lab.identification.measured import measure
from fidim_lab.identification.recipe import Recipe
from fidim_lab.identification.result_file import read_result
from fidim_lab.identification.trajectory import predict
from fidim_lab.model.dynamics import simulate_free_motion
from fidim_lab.model.mechanism import Mechanism

AHEAD = 10.0
"""s beyond twice what was recorded"""
STEP = 0.02
"""s between predicted points"""


def answer(request: dict[str, Any]) -> dict[str, Any]:
    """`t`, `positions` (of the main marker), `fitted` (s), `body`; or `doubt`, why there is none."""
    folder = Path(request["folder"])
    try:
        robot = read_robot(folder / ROBOT)
        body, whose = _body(folder, robot)
        return {**_predicted(robot, body, _window(request, robot)), "body": whose}
    except FidimError as error:
        return {"doubt": str(error).splitlines()[0]}


def _body(folder: Path, robot: Robot) -> tuple[Body, str]:
    file = folder / "result.json"
    return (read_result(file).body, "result") if file.exists() else (robot.nominal, "CAD")


def _window(request: dict[str, Any], robot: Robot) -> Window:
    seen = np.array([p or [np.nan] * 3 for p in request["positions"]], dtype=float)
    markers = np.full((len(seen), len(robot.markers), 3), np.nan)
    markers[:, 0] = seen
    lengths = np.array([[np.nan if v is None else v for v in row] for row in request["lengths"]], dtype=float)
    return Window(request["window"], Role.IDENTIFY, np.array(request["t"], dtype=float), markers[:, :1], lengths, None)


def _predicted(robot: Robot, body: Body, window: Window) -> dict[str, Any]:
    mechanism = Mechanism(robot)
    rate = 1.0 / float(np.median(np.diff(window.t)))
    measured = measure(mechanism, Campaign("live", robot, rate, (window,)), window, Recipe())
    found = predict(mechanism, body, measured)
    if found is None:
        return {"doubt": "the model does not follow this motion"}
    motion = found.motion
    end = float(window.t[-1]) + window.duration + AHEAD
    times = np.arange(motion.t[0], end, STEP)
    pose = Pose(motion.positions[0], motion.rotations[0])
    ahead = simulate_free_motion(mechanism, body, pose, motion.twists[0], times).motion
    paths = ahead.positions + np.einsum("nij,j->ni", ahead.rotations, robot.markers[0])
    return {
        "t": [round(float(t), 4) for t in ahead.t],
        "positions": [[round(float(v), 6) for v in row] for row in paths],
        "fitted": window.duration,
    }


def main() -> None:
    """One answer a line, until standard input ends."""
    os.nice(10)
    for text in sys.stdin:
        sys.stdout.write(json.dumps(answer(json.loads(text))) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
