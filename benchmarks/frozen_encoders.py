"""Encoders frozen in place and speed while their drum turns at 0.05 m/s: how far it gets.

python -m benchmarks.frozen_encoders           # each cable, both ways, at four steps of a rehearsal
python -m benchmarks.frozen_encoders --silent  # likewise, behind a drive whose own set-point (6062) is frozen, too
"""

import argparse
import tempfile
from pathlib import Path

from benchmarks.rehearsal import TWO, Rehearsal, Stage
from fidim_lab.data.robot_file import PAPERS_ROBOT, read_robot
from fidim_lab.errors import FidimError

STEPS = (("Ask", 0.3), ("Ask", 2.0), ("Record", 0.3), ("Settle", 0.05))
"""and s after their beginning; 2 s after the prompt a hand displaces the platform"""
SPEED = 0.05
"""m/s of cable"""


def frozen(cable: int, speed: float, step: str, after: float, *, silent: bool) -> tuple[float, str]:
    """m of cable that the drum goes, and what stopped the run. silent: no set-point shows it, either."""
    ways: list[float] = []

    def strike(stage: Stage) -> None:
        drum, shaft = stage.rig.laboratory.drums[cable - 1], stage.rig.laboratory.shafts[cable - 1]

        async def watch() -> None:
            while True:
                ways.append(drum.direction * shaft.motion(stage.now()).position * drum.metres_per_count)
                await stage.sleep(0.005)

        defects = stage.drive(cable).defects
        defects.encoder_frozen = defects.speed_frozen = True
        defects.demand_frozen = silent
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


def main() -> None:
    """Carry out and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--silent", action="store_true", help="the drive's set-point (6062) is frozen, too")
    silent = parser.parse_args().silent
    for step, after in STEPS:
        for cable in range(1, 5):
            for speed in (SPEED, -SPEED):
                way, ended = frozen(cable, speed, step, after, silent=silent)
                print(f"{step} +{after:g} s, cable {cable}: {1e3 * way:+.1f} mm, {ended}", flush=True)


if __name__ == "__main__":
    main()
