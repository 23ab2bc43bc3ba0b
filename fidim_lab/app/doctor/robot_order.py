"""Are the attachments in the order of the anchors, and which way is down? What one mistake, taken back, mends.

Only what people do is tried: attachments in another order than the anchors, gravity along another axis or upwards,
attachments measured from the other side of P.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations, permutations

import numpy as np

from fidim_lab.app.doctor.finding import RobotFinding
from fidim_lab.data.records import Robot
from fidim_lab.errors import InfeasibleError
from fidim_lab.identification.workspace import Workspace, rest_near
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.statics import Equilibrium

DEPTHS = (0.3, 0.5, 0.7, 0.9)
"""under the middle of the anchors, in the workspace's scale: all must do, for a wrong robot may rest at some"""
DOWN = np.array([0.0, 0.0, -9.81])


def order(robot: Robot, rests: Sequence[Equilibrium]) -> RobotFinding:
    """Seen along gravity no cables cross, or lead across the platform, as with exchanged attachments they do."""
    pose = rests[len(rests) // 2].pose
    across = np.linalg.svd(robot.gravity[np.newaxis])[2][1:]
    ends = [(across @ cable.d, across @ (pose.position + pose.rotation @ cable.a)) for cable in robot.cables]
    crossed = [(j + 1, k + 1) for (j, one), (k, other) in combinations(enumerate(ends), 2) if _cross(*one, *other)]
    anchors, tied = (np.array([pair[k] - np.mean([one[k] for one in ends], axis=0) for pair in ends]) for k in (0, 1))
    far = [str(k + 1) for k, (anchor, end) in enumerate(zip(anchors, tied, strict=True)) if anchor @ end < 0]
    says = [f"cables {j} and {k} cross" for j, k in crossed]
    says += [f"cable {', '.join(far)} is tied to the far side of the platform"] if far and robot.n > 2 else []
    if not says:
        return RobotFinding("order", True, f"Seen from above none of the {robot.n} cables cross.")
    advice = "Is each a that of the same cable's d? Such cables are seldom built."
    return RobotFinding("order", True, f"Seen from above {'; '.join(says)}.", advice)


def _cross(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> bool:
    """Whether the segments a to b and c to d of a plane cross."""

    def side(p: np.ndarray, q: np.ndarray, r: np.ndarray) -> float:
        return float((q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]))

    return side(a, b, c) * side(a, b, d) < 0 and side(c, d, a) * side(c, d, b) < 0


def what_would_rest(robot: Robot) -> str:
    """One sentence on the first change that lets it rest; empty where none of them does."""
    return next((says for says, other in _changed(robot) if _rests(other)), "")


def _changed(robot: Robot) -> Iterator[tuple[str, Robot]]:
    """The robot with one mistake taken back, the fewest exchanged cables first."""
    if not np.allclose(robot.gravity, DOWN):
        yield "With gravity = [0, 0, -9.81] it rests: which axis points upwards?", replace(robot, gravity=DOWN)
    numbers = tuple(range(robot.n))
    orders = sorted(
        permutations(numbers), key=lambda order: sum(k != one for k, one in zip(numbers, order, strict=True))
    )
    for order in orders[1:]:
        cables = tuple(replace(cable, a=robot.cables[k].a) for cable, k in zip(robot.cables, order, strict=True))
        shown = ", ".join(str(k + 1) for k in order)
        says = f"With the attachments (a) of cables {shown} in this order it rests: is each a that of its d?"
        yield says, replace(robot, cables=cables)
    mirrored = tuple(replace(cable, a=cable.a * np.array([1.0, 1.0, -1.0])) for cable in robot.cables)
    says = "With z of all attachments (a) of the other sign it rests: the platform tips over where G is above them."
    yield says, replace(robot, cables=mirrored)


def _rests(robot: Robot) -> bool:
    mechanism = Mechanism(robot)
    workspace = Workspace(robot)
    low, high = robot.limits.tension
    for depth in DEPTHS:
        try:
            found = rest_near(mechanism, workspace.place(np.zeros(3), depth)).tensions_in_newton(robot.mass)
        except InfeasibleError:
            return False
        if not (low <= found.min() and found.max() <= high):
            return False
    return True
