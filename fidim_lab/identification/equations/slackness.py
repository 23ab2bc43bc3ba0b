"""Slack cables in windows that were turned into equations: the tension each cable must have had (Eq. 8).

    −Ξᵀ τ = m W χ    by least squares at every sample, with the identified body

A cable that would have to push was slack, and the equations, which assume that it pulled, are wrong there. Maximum
likelihood finds the same by its simulation.
"""

from dataclasses import dataclass

import numpy as np

from fidim_lab.arrays import CableSeries, runs
from fidim_lab.identification.equations.estimate import Nine
from fidim_lab.identification.equations.problem import Problem, WindowEquations

SHORTEST = 0.03
"""s; filtered accelerations overshoot for less than that"""
PUSHED = 0.02
"""of the platform's weight: a push smaller than that is within what filtered accelerations are off by"""


@dataclass(frozen=True)
class Slack:
    """Where one cable was slack in one window."""

    window: str
    cable: int
    """1-based"""
    begin: float
    """s"""
    end: float
    """s, of the first stretch"""


def tensions(equations: WindowEquations, problem: Problem, values: Nine) -> CableSeries:
    """(N, n) tension of every cable at the used samples, N."""
    motion = equations.measured.motion
    xi = problem.mechanism.structure_matrix(motion.positions, motion.rotations)
    wrench = equations.platform @ np.concatenate([[1.0], values])
    pulled = -np.linalg.pinv(np.swapaxes(xi, 1, 2)) @ wrench[..., None]
    return problem.campaign.robot.mass * pulled[..., 0]


def slack(problem: Problem, values: Nine) -> tuple[Slack, ...]:
    """Every cable that was slack for longer than a filter's overshoot, with its first stretch."""
    found: list[Slack] = []
    robot = problem.campaign.robot
    weight = robot.mass * float(np.linalg.norm(robot.gravity))
    for equations in problem.equations:
        t, rate = equations.measured.motion.t, equations.measured.rate
        for cable, pushes in enumerate((tensions(equations, problem, values) < -PUSHED * weight).T, start=1):
            stretches = [(b, e) for b, e in runs(pushes) if (e - b) / rate >= SHORTEST]
            if stretches:
                begin, end = stretches[0]
                found.append(Slack(equations.window.id, cable, float(t[begin]), float(t[end - 1])))
    return tuple(found)


def slack_notes(problem: Problem, values: Nine) -> list[str]:
    """The same for a person: the cable that was slack first in each window, others follow from it."""
    first: dict[str, Slack] = {}
    for one in slack(problem, values):
        if one.window not in first or one.begin < first[one.window].begin:
            first[one.window] = one
    return [
        f"Window {one.window}: cable {one.cable} would have had to push from {one.begin:.2f} to {one.end:.2f} s: it "
        "was slack, or the geometry is wrong, and the equations do not hold there. Leave it out, or displace less."
        for one in first.values()
    ]
