"""Encoders frozen in place and speed while their drum turns at 0.05 m/s: how far it gets, and false alarms without it.

python -m benchmarks.frozen_encoders             # each cable, both ways, at four steps of a rehearsal
python -m benchmarks.frozen_encoders --honest 20 # sessions of twelve equilibria without a fault, by seed
"""

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

from benchmarks.rehearsal import TWO, Rehearsal, Stage, rehearsal, short
from fidim_lab.app import compose
from fidim_lab.data.robot_file import PAPERS_ROBOT, read_robot
from fidim_lab.errors import FidimError
from fidim_lab.identification.random_plan import WITHIN_LIMITS, random_plan

STEPS = (("Ask", 0.3), ("Ask", 2.0), ("Record", 0.3), ("Settle", 0.05))
"""and s after their beginning; 2 s after the prompt a hand displaces the platform"""
SPEED = 0.05
"""m/s of cable"""


def frozen(cable: int, speed: float, step: str, after: float) -> tuple[float, str]:
    """m of cable that the drum goes, and what stopped the run."""
    ways: list[float] = []

    def strike(stage: Stage) -> None:
        drum, shaft = stage.rig.laboratory.drums[cable - 1], stage.rig.laboratory.shafts[cable - 1]

        async def watch() -> None:
            while True:
                ways.append(drum.direction * shaft.motion(stage.now()).position * drum.metres_per_count)
                await stage.sleep(0.005)

        defects = stage.drive(cable).defects
        defects.encoder_frozen = defects.speed_frozen = True
        stage.spin(cable, speed, unseen=True)
        stage.spawn(watch())

    with tempfile.TemporaryDirectory() as folder:
        run = Rehearsal(read_robot(PAPERS_ROBOT), Path(folder) / "run")
        run.plan = TWO
        run.at(step, strike, after=after)
        try:
            trip = run.run().trip
            ended = "nothing" if trip is None else trip.guard
        except FidimError as error:  # a plant whose cables hang slack ends the simulation
            ended = error.message
    return ways[-1] - ways[0], ended


def honest(seed: int) -> str:
    """How a session without a fault ended."""
    robot = read_robot(PAPERS_ROBOT)
    plan = random_plan(robot, "honest", 12, 0, seed, WITHIN_LIMITS)
    with tempfile.TemporaryDirectory() as folder, patch.object(rehearsal, "STANDS", plan):
        run = Rehearsal(robot, Path(folder) / "run")
        settings = short(seconds=6.0)
        limits = compose.length_limits(plan)
        run.seed, run.plan = seed, plan
        run.settings = replace(settings, motion=replace(settings.motion, length_limits=limits))
        ended = run.run()
        return f"{len(ended.report.accepted)} windows accepted, guard {ended.trip.guard if ended.trip else '–'}"


def main() -> None:
    """Carry out and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--honest", type=int, default=0)
    seeds = parser.parse_args().honest
    for seed in range(1, seeds + 1):
        print(f"seed {seed}: {honest(seed)}", flush=True)
    if seeds:
        return
    for step, after in STEPS:
        for cable in range(1, 5):
            for speed in (SPEED, -SPEED):
                way, ended = frozen(cable, speed, step, after)
                print(f"{step} +{after:g} s, cable {cable}: {1e3 * way:+.1f} mm, {ended}", flush=True)


if __name__ == "__main__":
    main()
