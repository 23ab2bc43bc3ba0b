"""Is the ± of a pendulum that only a phone recorded right? Errors over ± of simulated sessions, from file to answer.

    python benchmarks/identification/gyro_coverage.py [DRAWS] [FIRST SEED]

Each draw: another body 10 to 20 % off the robot file, anchors 1 mm and attachments 0.5 mm off as a usual survey has
them, cords 0.5 mm off the tape, drag, a phone that lies crooked, with bias, drift, jitter and lost samples; two swings
of 15 s at each of two lengths. Prints error/± of every parameter that is seen, and their root mean squares.
"""

import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.identification.phone import PhoneNoise, as_phyphox, draw_seat, record_phone
from fidim_lab.app.records.import_gyro import GyroOptions, import_gyro_command
from fidim_lab.app.workflows.identify import run_identify
from fidim_lab.data.records import PARAMETER_NAMES, Body
from fidim_lab.data.robot_file import read_robot
from sim_backends.plant.hidden import parse_effect
from sim_backends.plant.world import World, make_world

ROBOT = Path(__file__).parents[2] / "examples" / "robots" / "bifilar.toml"
LENGTHS = ("2.38,2.38", "1.88,1.93")
EACH = 2
SECONDS = 15.0


def true_world(rng: np.random.Generator) -> World:
    """A pendulum that is not quite the robot file's."""
    drag = (parse_effect("rotational-drag:c=0.005", 2), parse_effect("air-drag-linear:c=0.05", 2))
    world = make_world(read_robot(ROBOT), rng, drag)
    cables = (
        replace(cable, d=cable.d + 1e-3 * rng.normal(size=3), a=cable.a + 5e-4 * rng.normal(size=3))
        for cable in world.cables
    )
    return replace(world, cables=tuple(cables))


def write_session(world: World, rng: np.random.Generator, folder: Path, seconds: float = SECONDS) -> list[Path]:
    """One file for each swing."""
    noise = PhoneNoise()
    seat = draw_seat(rng, noise)
    files: list[Path] = []
    for text in np.repeat(LENGTHS, EACH):
        true = np.array([float(part) for part in text.split(",")]) + 5e-4 * rng.normal(size=world.n)
        aside = rng.uniform(0.03, 0.07, 2) * rng.choice([-1, 1], 2)
        files.append(folder / f"swing{len(files) + 1}.csv")
        files[-1].write_text(as_phyphox(record_phone(world, true, aside, seconds, rng, noise, seat)), encoding="utf-8")
    return files


def errors(seed: int) -> np.ndarray:
    """(9,) error over ±; NaN where the recordings say that they do not show a parameter."""
    rng = np.random.default_rng(seed)
    world: World = true_world(rng)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        files = write_session(world, rng, folder)
        lengths = tuple(str(text) for text in np.repeat(LENGTHS, EACH))
        import_gyro_command(files, folder / "campaign", GyroOptions(ROBOT, lengths), None)
        result = run_identify(folder / "campaign")
    truth: Body = world.body
    found = [result.parameters[name] for name in PARAMETER_NAMES]
    print(seed, result.outcome.code, [f"{p.value:.5f} ± {p.sd:.5f}" for p in found], flush=True)
    return np.array([(p.value - t) / p.sd if p.seen else np.nan for p, t in zip(found, truth.vector, strict=True)])


def main() -> None:
    """All draws, then the figure."""
    draws, first = (int(sys.argv[k]) if len(sys.argv) > k else usual for k, usual in ((1, 20), (2, 1)))
    found = np.array([errors(seed) for seed in range(first, first + draws)])
    for name, column in zip(PARAMETER_NAMES, found.T, strict=True):
        seen = column[np.isfinite(column)]
        rms, largest = np.sqrt(np.mean(seen**2)), np.abs(seen).max(initial=0.0)
        print(f"{name}: rms(error/±) {rms:.2f}, largest {largest:.1f}, seen in {len(seen)}")
    print(f"all: {np.sqrt(np.nanmean(found**2)):.2f}")


if __name__ == "__main__":
    main()
