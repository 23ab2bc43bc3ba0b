"""A worker: on each line of standard input a recording so far, on standard output the model's prediction of it.

The initial state is fitted to the first seconds, with the body of the run's result, or of CAD where there is none yet;
from there the model runs on, so that later samples can be held against it.
"""

import json
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np

from fidim_lab.app.tui.foresight import FIRST, MOST
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

AHEAD = 60.0
"""s beyond what was recorded"""
STEP = 0.02
"""s between predicted points"""


def answer(request: dict[str, Any]) -> dict[str, Any]:
    """`t`, `positions` (of the main marker), `fitted` (s), `body`; or `doubt`, why there is none."""
    folder = Path(request["folder"])
    try:
        robot = read_robot(folder / ROBOT)
        body, whose = _body(folder, robot)
        found: dict[str, Any] = {"doubt": "nothing was recorded"}
        for seconds in (MOST, FIRST):
            found = _predicted(robot, body, _window(request, robot, seconds), float(request["t"][-1]))
            if "doubt" not in found:
                break
        return found if "doubt" in found else {**found, "body": whose}
    except FidimError as error:
        return {"doubt": str(error).splitlines()[0]}


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


def _predicted(robot: Robot, body: Body, window: Window, now: float) -> dict[str, Any]:
    mechanism = Mechanism(robot)
    rate = 1.0 / float(np.median(np.diff(window.t)))
    measured = measure(mechanism, Campaign("live", robot, rate, (window,)), window, Recipe())
    found = predict(mechanism, body, measured)
    if found is None:
        return {"doubt": "the model does not follow this motion"}
    motion = found.motion
    end = now + AHEAD
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
