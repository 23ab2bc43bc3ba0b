"""What `explain` says where lengths or cameras read wrongly over a session, and where they do not.

python -m benchmarks.readings --runs 24 [--first 1] [--write]

Each run takes the next kind: nothing; lengths that drift (all cables, or one), step or scatter (eccentric drums, or an
encoder coarser than stated); cameras that drift; markers noisier than stated; a robot file off by a survey's error; one
effect of the catalogue; a load that is put on at once or bit by bit. Sizes are log-uniform. It records 7 + 4 windows of
6 s in the independent simulator and explains them. Right: the kind (and cable) is told and nothing else, or nothing of
this kind where there is none.
--write puts the table into docs/benchmarks/readings.md.
"""

import argparse
from dataclasses import dataclass, replace
from time import process_time

import numpy as np

from benchmarks.page import table, write_section
from benchmarks.sealed.campaigns import with_survey_errors
from fidim_lab.data.records import Campaign
from fidim_lab.data.robot_file import PAPERS_ROBOT, read_robot
from fidim_lab.identification.random_plan import random_plan
from fidim_lab.mismatch.conclusion.explanation import Explanation
from fidim_lab.mismatch.explain import explain
from sim_backends.plant.hidden import parse_effect
from sim_backends.plant.sensors import Noise
from sim_backends.plant.world import make_world
from sim_backends.simulate import BETWEEN, Sampling, simulate_campaign

IDENTIFY, VALIDATE, SECONDS = 7, 4, 6.0
HOURS = (IDENTIFY + VALIDATE - 1) * BETWEEN / 3600
KINDS = (
    "nothing",
    "length-drift",
    "length-drift of one cable",
    "length-step",
    "length-scatter",
    "coarse encoder",
    "camera-drift",
    "marker-noise",
    "survey",
    "swivel-friction",
    "body-step",
    "body-drift",
)
BODY = ("body-step", "body-drift")
LOAD = np.array([0.05, -0.05, 0.1])
"""m, from P to the load that is put on"""
SMALLEST, LARGEST = 1.5e-4, 1.5e-3
"""m, over the session: from an eighth of a millimetre, which encoders of 0.02 mm show, to what cameras see at once;
of the body, what its centre of mass moves by"""


@dataclass(frozen=True)
class Row:
    """One run."""

    seed: int
    hidden: str
    size: float
    verdict: str
    named: str
    readings: str
    right: bool
    cpu: float


def run(seed: int) -> Row:
    """Record, explain, judge."""
    kind = KINDS[(seed - 1) % len(KINDS)]
    rng = np.random.default_rng([seed, 41])
    size, cable = float(np.exp(rng.uniform(np.log(SMALLEST), np.log(LARGEST)))), int(rng.integers(1, 5))
    made = campaign(seed, kind, size, cable, rng)
    begin = process_time()
    found = explain(made)
    named = ", ".join(f"{cause.id} {cause.cable or ''}".strip() for cause in found.effects) or "–"
    readings = ", ".join(f"{one.id} {one.cable or ''}".strip() for one in found.readings) or "–"
    right = is_right(kind, cable, found)
    return Row(seed, kind, size, found.verdict.value, named, readings, right, round(process_time() - begin, 1))


def campaign(seed: int, kind: str, size: float, cable: int, rng: np.random.Generator) -> Campaign:
    """What is recorded of a world with this error, and its robot file."""
    robot = read_robot(PAPERS_ROBOT)
    steady, load = size / HOURS, size * robot.mass / float(np.linalg.norm(LOAD - robot.nominal.com))
    half = rng.uniform(0.25, 0.75) * HOURS * 3600
    turn = rng.standard_normal(3)
    x, y, z = steady * turn / np.linalg.norm(turn)
    hidden = {
        "length-drift": f"length-drift:rate={steady}",
        "length-drift of one cable": f"length-drift:rate={steady},cable={cable}",
        "length-step": f"length-step:by={size},cable={cable},at={half}",
        "length-scatter": f"length-scatter:size={size}",
        "camera-drift": f"camera-drift:x={x},y={y},z={z}",
        "swivel-friction": "swivel-friction:c=0.01",
        "body-step": f"body-step:m={load},x={LOAD[0]},y={LOAD[1]},z={LOAD[2]},at={half}",
        "body-drift": f"body-drift:rate={load / HOURS},x={LOAD[0]},y={LOAD[1]},z={LOAD[2]}",
    }.get(kind)
    noise = Noise.of(robot)
    if kind == "coarse encoder":
        noise = replace(noise, encoder=2 * size)
    if kind == "marker-noise":
        noise = replace(noise, marker=float(rng.uniform(1.2, 2.0)) * noise.marker)
    world = make_world(robot, np.random.default_rng(seed), () if hidden is None else (parse_effect(hidden, robot.n),))
    plan = random_plan(robot, "readings", IDENTIFY, VALIDATE, seed)
    made, _ = simulate_campaign(robot, plan, world, np.random.default_rng(seed + 1), noise, recording=Sampling(SECONDS))
    return replace(made, robot=with_survey_errors(robot, size, 0.0, rng)) if kind == "survey" else made


def is_right(kind: str, cable: int, found: Explanation) -> bool:
    """Whether the answer names the error alone."""
    effects = [cause.id for cause in found.effects if cause.id not in ("length-drift", *BODY)]
    told = [(one.id, one.cable) for one in found.readings]
    wanted = {
        "length-drift": [("length-drift", None)],
        "length-drift of one cable": [("length-drift", cable)],
        "length-step": [("length-step", cable)],
        "length-scatter": [("length-scatter", None)],
        "coarse encoder": [("length-scatter", None)],
        "camera-drift": [("camera-drift", None)],
        "marker-noise": [("marker-noise", None)],
        **{id: [(id, None)] for id in BODY},
    }.get(kind, [])
    return told == wanted and effects == (["swivel-friction"] if kind == "swivel-friction" else [])


def report(rows: list[Row]) -> str:
    """What they come to, and each of them."""
    head = ("seed", "hidden", "size, mm", "verdict", "named", "readings", "right", "CPU s")
    lines = [
        (row.seed, row.hidden, f"{1e3 * row.size:.2g}", row.verdict, row.named, row.readings, row.right, row.cpu)
        for row in rows
    ]
    return f"{sum(row.right for row in rows)} of {len(rows)} right.\n\n{table(head, lines)}"


def main() -> None:
    """As the module says."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--write", action="store_true")
    options = parser.parse_args()
    rows: list[Row] = []
    for seed in range(options.first, options.first + options.runs):
        rows.append(run(seed))
        print(rows[-1], flush=True)
    print(report(rows))
    if options.write:
        command = f"python -m benchmarks.readings --runs {options.runs} --first {options.first}"
        write_section("readings", "Lengths and cameras that read wrongly", command, report(rows))


if __name__ == "__main__":
    main()
