"""How far survey, zeros and CAD leave the marker from where the robot file puts it: behind `[place]` of a rig file.

`python -m benchmarks.place_errors [--robots 40]`: robots are drawn around the built-in one; what a check at rest, one
over a move and a first jog would find of each is printed as quantiles.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

import fidim_lab.data.robots as robots
from fidim_lab.data.records import Robot
from fidim_lab.data.robot_file import read_robot
from fidim_lab.errors import InfeasibleError
from procedures.expected import NominalRest

START, END = (1.34283, 1.43119, 1.56772, 1.45231), (1.30283, 1.39119, 1.52772, 1.41231)
"""m: where the simulated robot rests, and 90 mm of the marker higher"""
SURVEY, ATTACHMENT, ZERO, MARKER = 2e-3, 1e-3, 2e-3, 1e-3
"""m, one standard deviation of each coordinate, of each length"""
NAMES = ("marker off, mm", "change over a move, part", "answer to a jog, part")
JOG = 4e-3
"""m"""


def drawn(robot: Robot, rng: np.random.Generator, com: float) -> Robot:
    """A robot that its file describes with these errors; com: m, one standard deviation."""
    cables = tuple(
        replace(c, d=c.d + rng.normal(0.0, SURVEY, 3), a=c.a + rng.normal(0.0, ATTACHMENT, 3)) for c in robot.cables
    )
    body = replace(robot.nominal, com=robot.nominal.com + rng.normal(0.0, com, 3))
    return replace(robot, cables=cables, nominal=body, marker=robot.marker + rng.normal(0.0, MARKER, 3))


def places(rest: NominalRest, zeros: np.ndarray) -> np.ndarray:
    """(2 + n, 3) the marker at START, at END, and at START with one cable after another longer, m."""
    start = np.array(START)
    jogs = start + JOG * np.eye(len(start))
    return np.array([rest.at(tuple(map(float, row + zeros))).marker for row in (start, np.array(END), *jogs)])


def main() -> None:
    """Draw and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robots", type=int, default=40)
    count = parser.parse_args().robots
    robot = read_robot(Path(robots.__path__[0]) / "irma4.toml")
    said = places(NominalRest(robot), np.zeros(robot.n))
    for com in (0.0, 0.01, 0.02):
        rng = np.random.default_rng(0)
        rows: list[list[float]] = []
        for _ in range(count):
            other, zeros = drawn(robot, rng, com), rng.normal(0.0, ZERO, robot.n)
            try:
                true = places(NominalRest(other), zeros)
            except InfeasibleError:
                continue
            moved, jogs = true[1] - true[0] - (said[1] - said[0]), true[2:] - true[0]
            model = said[2:] - said[0]
            missed = np.linalg.norm(jogs - model, axis=1) / np.linalg.norm(model, axis=1)
            part = np.linalg.norm(moved) / np.linalg.norm(said[1] - said[0])
            factor = np.sum(jogs * model) / np.sum(model**2)
            rows.append(
                [1e3 * float(np.linalg.norm(true[0] - said[0])), float(part), float(missed.max()), float(factor)]
            )
        table = np.array(rows)
        print(f"centre of mass known to {1e3 * com:.0f} mm ({len(rows)} robots):")
        for name, column in zip(NAMES, table.T[:3], strict=True):
            print(
                f"  {name}: median {np.median(column):.3g}, 95 % {np.quantile(column, 0.95):.3g}, "
                f"99 % {np.quantile(column, 0.99):.3g}"
            )
        print(f"  all winches together: {table[:, 3].mean():.3f} ± {table[:, 3].std():.3f}")


if __name__ == "__main__":
    main()
