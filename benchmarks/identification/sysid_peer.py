"""Accuracy and time beside `mujoco.sysid` (pose output error) and the paper's total least squares, on the same windows.

The peer lives in an environment of its own; it is no dependency:

    python -m venv /tmp/peers && /tmp/peers/bin/pip install "mujoco[sysid]"
    nice python -m benchmarks.identification.sysid_peer --python /tmp/peers/bin/python

`sysid_worker` is what runs there. It takes minutes of CPU; `--windows` and `--seconds` limit it.
"""

import argparse
import json
import subprocess
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from time import process_time

import numpy as np

from benchmarks.identification.campaigns import Known, simulated
from benchmarks.page import table, write_section
from fidim_lab.data.records import Body, Campaign, Pose, Role, Window
from fidim_lab.errors import FidimError
from fidim_lab.identification.equations import total_least_squares
from fidim_lab.identification.equations.problem import build
from fidim_lab.identification.mle.fit import fit
from fidim_lab.identification.mle.starts.start import first_guess
from fidim_lab.identification.mle.trajectories.recordings import prepare
from fidim_lab.identification.motion.recipe import BEST, PAPER, Recipe
from fidim_lab.model.mechanism import Mechanism
from sim_backends.mujoco_world.multibody import multibody_xml
from sim_backends.plant.world import make_world

TITLE = "Beside mujoco.sysid and the paper's total least squares"
WORKER = Path(__file__).with_name("sysid_worker.py")
SHOWN = ("s_x, µm", "s_y, µm", "s_z, %", "I_xx, %", "I_yy, %", "I_zz, %")
FULL = (0, 4, 8, 1, 2, 5)
"""where xx, yy, zz, xy, xz, yz are in a flat 3 × 3 matrix"""


@dataclass(frozen=True)
class Answer:
    values: np.ndarray
    """nine"""
    sd: np.ndarray
    cpu: float
    """s"""
    remark: str = ""


def task(campaign: Campaign) -> dict[str, object]:
    """What the peer is given: for each window the model at our first guess of its start, and what was recorded."""
    robot = campaign.robot
    mechanism = Mechanism(robot)
    world = replace(make_world(robot, np.random.default_rng(0), body=robot.nominal), mass=robot.mass)
    windows: list[dict[str, object]] = []
    for window in campaign.of_role(Role.IDENTIFY):
        recording = prepare(window, robot)
        guess = first_guess(mechanism, robot.nominal, recording)
        lengths = mechanism.lengths(guess.position[np.newaxis], guess.rotation[np.newaxis])[0]
        windows.append({
            "t": recording.t, "markers": recording.markers[:, 0], "noise": robot.sensors.marker_noise,
            "cables": robot.n, "resolution": robot.sensors.encoder_resolution, "longer": recording.lengths - lengths,
            "xml": multibody_xml(world, Pose(guess.position, guess.rotation)), "twist": guess.twist,
            "rotation": guess.rotation,
        })  # fmt: skip
    nominal = robot.nominal
    return {"windows": windows, "marker": robot.marker, "com": nominal.com, "inertia": nominal.inertia_matrix}


def peer(campaign: Campaign, python: Path) -> Answer:
    with tempfile.TemporaryDirectory() as folder:
        given, out = Path(folder) / "task.npz", Path(folder) / "answer.json"
        np.savez(given, task=np.array(task(campaign), dtype=object))
        subprocess.run([str(python), str(WORKER), str(given), str(out)], check=True, env={"OPENBLAS_NUM_THREADS": "1"})
        found = json.loads(out.read_text())

    def nine(values: list[float]) -> np.ndarray:
        return np.array([*values[:3], *np.array(values[3:])[list(FULL)]])

    remark = f"{found['simulations']} simulations, χ²/rows {found['chi2']:.3f}"
    return Answer(nine(found["values"]), nine(found["sd"]), found["cpu"], remark)


def ours(campaign: Campaign) -> Answer:
    mechanism, windows = Mechanism(campaign.robot, native=True), campaign.of_role(Role.IDENTIFY)
    fit(mechanism, windows[:1])  # builds expressions and kernels
    found, cpu = timed(lambda: fit(mechanism, windows))
    return Answer(found.values[:9], found.sd[:9], cpu, f"χ²/dof {found.chi2_per_dof:.3f}")


def tls(recipe: Recipe) -> Callable[[Campaign], Answer]:
    def estimate(campaign: Campaign) -> Answer:
        found, cpu = timed(lambda: total_least_squares.estimate(build(campaign, recipe)))
        return Answer(found.body.vector, np.sqrt(np.diag(found.covariance)), cpu)

    return estimate


def timed(action):
    begin = process_time()
    return action(), process_time() - begin


def row(name: str, estimate: Callable[[Campaign], Answer], campaign: Campaign, truth: Body) -> list[object]:
    try:
        found = estimate(campaign)
    except FidimError as refusal:
        return [name, *[""] * (len(SHOWN) + 2), f"refused: {refusal}"]
    error = found.values - truth.vector
    cells = [f"{1e6 * value:+.1f}" for value in error[:2]]
    cells += [f"{100 * error[k] / truth.vector[k]:+.4f}" for k in range(2, 6)]
    ratio = float(np.sqrt(np.mean((error / found.sd) ** 2)))
    return [name, *cells, f"{ratio:.1f}", f"{found.cpu:.1f}", found.remark]


def shortened(window: Window, seconds: float) -> Window:
    use = window.t <= window.t[0] + seconds + 1e-9
    lengths = None if window.lengths is None else window.lengths[use]
    return replace(
        window, t=window.t[use], markers=window.markers[use], lengths=lengths, currents=None, further={}
    )  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--python", type=Path, required=True, help="Python that has mujoco[sysid]")
    parser.add_argument("--windows", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=10.0)
    options = parser.parse_args()
    known: Known = simulated(1)
    chosen = known.campaign.of_role(Role.IDENTIFY)[: options.windows]
    campaign = replace(known.campaign, windows=tuple(shortened(window, options.seconds) for window in chosen))
    estimators: dict[str, Callable[[Campaign], Answer]] = {
        "tls, as the paper": tls(PAPER),
        "tls": tls(BEST),
        "mle": ours,
        "mujoco.sysid": lambda c: peer(c, options.python),
    }
    rows = [row(name, estimate, campaign, known.body) for name, estimate in estimators.items()]
    asked = [str(options.python), "-c", "import mujoco; print(mujoco.__version__)"]
    version = subprocess.run(asked, capture_output=True, text=True, check=True).stdout.strip()
    head = ["estimator", *(f"error of {name}" for name in SHOWN), "rms error/stated sd", "CPU s", ""]
    text = f"""The first {options.windows} windows of {options.seconds:g} s of campaign 1 of "Accuracy", one marker with
0.1 mm of noise, all from the robot file's body (s_z is 13 % off, the moments 3 to 16 %). mujoco.sysid {version},
`minimize` with finite differences, one thread: four tendons round swivelling pulleys held by equalities
(`sim_backends/mujoco_world`), RK4 at 0.5 ms. It has no start states, priors or horizon of its own: they are given
through its hooks (start states from our first guess, horizons 0.3, 1, 3, {options.seconds:g} s), and simulations that a
column does not touch are not repeated. Compiled kernels are built before times are taken.

{table(head, rows)}"""
    print(text)
    command = "python -m benchmarks.identification.sysid_peer --python PEERS/bin/python"
    write_section("identification", TITLE, f"{command} --windows {options.windows} --seconds {options.seconds:g}", text)


if __name__ == "__main__":
    main()
