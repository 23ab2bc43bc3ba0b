"""Is the ± of a pendulum that was only timed right? Errors over ± of simulated sessions, from file to answer.

    python benchmarks/identification/period_coverage.py [DRAWS] [FIRST SEED] [bifilar | trifilar] [level | no-level]

Each draw: another body 10 to 20 % off the robot file, anchors 1 mm and attachments 0.5 mm off as a usual survey has
them, cords 0.5 mm off the tape. At each of two lengths every swing is pushed, integrated by the independent plant at
real amplitudes, and timed: 20 swings by a hand that is 0.1 s off; a level reads the tilt at rest to 2 mrad. Prints
error/± of every parameter that is seen, and their root mean squares.
"""

import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import numpy as np

from benchmarks.identification.stopwatch import WATCHED, WatchedPendulum
from fidim_lab.app.records.import_periods import import_periods_command
from fidim_lab.app.workflows.identify import run_identify
from fidim_lab.data.records import PARAMETER_NAMES, Body
from fidim_lab.data.robot_file import read_robot
from fidim_lab.model.equilibria import pose_from_lengths
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.modes import modes
from sim_backends.plant.world import World, make_world

ROBOTS = Path(__file__).parents[2] / "examples" / "robots"
LENGTHS = {"bifilar": ([2.38, 2.38], [1.88, 1.93]), "trifilar": ([2.0, 2.0, 2.0], [1.6, 1.65, 1.7])}
SWINGS, HAND, LEVEL = 20, 0.1, 2e-3
ASIDE = 0.08
"""rad of the platform or of the cords, about"""


def true_world(rng: np.random.Generator, name: str = "bifilar") -> World:
    """A pendulum that is not quite the robot file's."""
    world = make_world(read_robot(ROBOTS / f"{name}.toml"), rng)
    cables = (
        replace(cable, d=cable.d + 1e-3 * rng.normal(size=3), a=cable.a + 5e-4 * rng.normal(size=3))
        for cable in world.cables
    )
    return replace(world, cables=tuple(cables))


def noted(world: World, name: str, rng: np.random.Generator, *, level: bool = True, lengths: int = 2) -> str:
    """What a person writes down of one session, at so many lengths: a table."""
    robot = replace(read_robot(ROBOTS / f"{name}.toml"), cables=world.cables)
    mechanism = Mechanism(robot)
    cords = [f"l{k}" for k in range(1, robot.n + 1)]
    lines = [",".join(["motion", *cords, "swings", "time (s)", "sd (s)", "amplitude", "tilt_x", "tilt_y", "tilt_sd"])]
    for taped in LENGTHS[name][:lengths]:
        true = np.array(taped) + 5e-4 * rng.normal(size=robot.n)
        rest = pose_from_lengths(mechanism, world.body, true)
        found = modes(mechanism, world.body, rest)  # which way to push it; all that is timed is the plant's
        pendulum = WatchedPendulum(world, true)
        tilt = np.array(pendulum.tilt) + LEVEL * rng.normal(size=2)
        read = f"{tilt[0]:.4f},{tilt[1]:.4f},{LEVEL}" if level else ",,"
        for frequency, shape in zip(found.frequencies, found.shapes.T, strict=True):
            arm = rest.pose.rotation @ world.body.com
            velocity, turn = shape[:3] + np.cross(shape[3:], arm), rest.pose.rotation.T @ shape[3:]
            swinging = dict(
                zip(("along", "across", "yaw", "rock"), (*velocity[:2], 0.2 * turn[2], 0.2 * turn[0]), strict=True)
            )
            motion = max(swinging, key=lambda one: abs(swinging[one]))
            seen = shape[:2] / np.mean(taped) if motion in ("along", "across") else shape[3:]
            push = 2 * np.pi * frequency * ASIDE * rng.uniform(0.5, 1.5) / np.linalg.norm(seen)
            timing = pendulum.timed(motion, push * np.concatenate([velocity, turn]), (WATCHED + 2.5) / frequency)
            amplitude = timing.amplitude / (np.mean(taped) if motion in ("along", "across") else 1.0)
            time = SWINGS * timing.period + HAND * rng.normal()
            lines.append(f"{motion},{','.join(map(str, taped))},{SWINGS},{time:.2f},{HAND},{amplitude:.2f},{read}")
    return "\n".join(lines) + "\n"


def errors(seed: int, name: str, *, level: bool, lengths: int = 2) -> np.ndarray:
    """(9,) error over ±; NaN where the periods say that they do not show a parameter."""
    rng = np.random.default_rng(seed)
    world = true_world(rng, name)
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        (folder / "times.csv").write_text(noted(world, name, rng, level=level, lengths=lengths), encoding="utf-8")
        import_periods_command([folder / "times.csv"], folder / "timed", ROBOTS / f"{name}.toml", (), None)
        begin = perf_counter()
        result = run_identify(folder / "timed")
        took = perf_counter() - begin
    truth: Body = world.body
    found = [result.parameters[one] for one in PARAMETER_NAMES]
    shown = [f"{p.value:.4f} ± {p.sd:.4f}{'' if p.seen else ' -'}" for p in found]
    print(
        f"{seed} {result.outcome.code} {took:.1f} s χ²/dof {(result.noise_ratio or 0) ** 2:.1f} "
        f"{max(w.chi2_per_dof or 0.0 for w in result.windows):.1f} {shown}",
        flush=True,
    )
    return np.array([(p.value - t) / p.sd if p.seen else np.nan for p, t in zip(found, truth.vector, strict=True)])


def main() -> None:
    """All draws, then the figure."""
    asked = sys.argv[1:]
    draws, first = (int(asked[k]) if len(asked) > k else usual for k, usual in ((0, 20), (1, 1)))
    name = asked[2] if len(asked) > 2 else "bifilar"
    level = "no-level" not in asked
    found = np.array([errors(seed, name, level=level) for seed in range(first, first + draws)])
    for one, column in zip(PARAMETER_NAMES, found.T, strict=True):
        seen = column[np.isfinite(column)]
        rms = np.sqrt(np.mean(seen**2)) if len(seen) else np.nan
        print(f"{one}: rms(error/±) {rms:.2f}, largest {np.abs(seen).max(initial=0.0):.1f}, seen in {len(seen)}")
    print(f"all: {np.sqrt(np.nanmean(found**2)):.2f}")


if __name__ == "__main__":
    main()
