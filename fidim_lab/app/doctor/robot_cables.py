"""Are the cables of a robot file as somebody can have built them? Copied tables, axes the wrong way round, no roll."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from fidim_lab.app.doctor.finding import RobotFinding
from fidim_lab.arrays import PerCable, Positions
from fidim_lab.data.records import Robot
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.statics import Equilibrium

UNLIKE = 40.0
"""° by which a cable turns around its pulley otherwise than the others do. Of the paper's robot and the robots of
`fidim init` they differ by up to 11°; an axis that is turned round or copied from another cable differs by 60° and more
where cables leave their pulleys at 120° or at 60°"""
MIRRORED = 20.0
"""° within which an angle is the supplement of the others: z turned round makes φ of π − φ"""
AWAY = 90.0
"""° of swivel angle beyond which x points away from the platform"""
UPRIGHT = 0.95
"""|cos| of the angle between z and the vertical: then x is free to choose, and may be the same for all"""
THIN = 0.03
"""second singular value of points about their mean over the first, below which they lie on a line: 3 cm in a metre"""


def copies(robot: Robot) -> RobotFinding:
    """No two cables have one anchor: that is a table that was copied and not changed."""
    for (j, one), (k, other) in combinations(enumerate(robot.cables, start=1), 2):
        if np.array_equal(one.d, other.d):
            same = " and a" if np.array_equal(one.a, other.a) else ""
            found = f"Cables {j} and {k} have the same d{same}: {_numbers(one.d)} m."
            return RobotFinding(
                "copies", False, found, f"Measure D of cable {k}: its table looks copied from cable {j}."
            )
    return RobotFinding("copies", True, f"All {robot.n} anchors differ.")


def roll(robot: Robot) -> RobotFinding:
    """Anchors and attachments of three cables or more are not on one line."""
    anchors, held = (np.array([getattr(cable, key) for cable in robot.cables]) for key in ("d", "a"))
    wide = {"anchors (d)": _slenderness(anchors), "attachments (a)": _slenderness(held)}
    shown = ", ".join(f"{name} {value:.2f}" for name, value in wide.items())
    found = f"Width divided by length: {shown}."
    thin = [name for name, value in wide.items() if value < THIN]
    if robot.n < 3 or not thin:
        return RobotFinding(
            "roll", True, found if robot.n > 2 else f"{robot.n} cables leave the platform free to roll."
        )
    advice = (
        f"All {' and all '.join(thin)} lie on one line: no cable resists a turn about it, only gravity does. Check the "
        "coordinates; if it is built so, expect one slow mode, and an inertia about that line that is poorly seen."
    )
    return RobotFinding("roll", True, found, advice)


def pulleys(mechanism: Mechanism, rests: Sequence[Equilibrium]) -> RobotFinding:
    """Cables leave their pulleys forwards, and all of them alike."""
    robot, rest = mechanism.robot, rests[len(rests) // 2]
    turned = [k for k, cable in enumerate(robot.cables) if cable.radius > 0]
    if not turned:
        return RobotFinding("pulleys", True, "No cable passes a pulley (radius 0).")
    at = (rest.pose.position[np.newaxis], rest.pose.rotation[np.newaxis])
    wraps = np.degrees(mechanism.wrap_angles(*at)[0])
    shown = ", ".join(f"{wraps[k]:.0f}°" for k in turned)
    found = f"In the middle of the workspace cables turn around their pulleys by {shown}."
    backwards = [k for k in turned if wraps[k] > 180.0]
    if backwards:
        named = ", ".join(str(k + 1) for k in backwards)
        advice = (
            f"Cable {named} leaves its pulley backwards: A is nearer to the swivel axis than the pulley is wide, or "
            "z is wrong. z points along the cable from the winch to D."
        )
        return RobotFinding("pulleys", False, found, advice)
    away = _away(robot, np.degrees(mechanism.swivel_angles(*at)[0]), turned)
    return RobotFinding("pulleys", True, found, _unlike(robot, wraps, turned) or away)


def _unlike(robot: Robot, wraps: PerCable, turned: list[int]) -> str:
    """What to look at where one cable turns otherwise than the others; empty where none does."""
    for k in turned if len(turned) > 2 else ():
        usual = float(np.median([wraps[other] for other in turned if other != k]))
        if abs(wraps[k] - usual) < UNLIKE:
            continue
        like = _same_axes(robot, k)
        mirrored = abs(180.0 - wraps[k] - usual) < MIRRORED
        causes = [f"its x, y, z are those of cable {like}"] if like else []
        causes += ["its z looks turned round (z points along the cable from the winch to D)"] if mirrored else []
        why = " or ".join(causes) or "check its d and z, unless its winch is placed differently from the others"
        return f"Cable {k + 1} turns by {wraps[k]:.0f}°, the others by about {usual:.0f}°: {why}."
    return ""


def _away(robot: Robot, swivels: PerCable, turned: list[int]) -> str:
    """A cable with the axes of another whose x points away from the platform; upright axes are everybody's."""
    down = robot.gravity / np.linalg.norm(robot.gravity)
    for k in turned:
        like, upright = _same_axes(robot, k), abs(robot.cables[k].z @ down) > UPRIGHT
        if like and not upright and abs(swivels[k]) > AWAY:
            return (
                f"The x, y, z of cable {k + 1} are those of cable {like}, and its x points away from the platform "
                f"(swivel angle {swivels[k]:.0f}°): measure its own."
            )
    return ""


def _same_axes(robot: Robot, k: int) -> int:
    """The number (from 1) of another cable with the same x, y, z; 0 where there is none."""
    axes = [np.array([cable.x, cable.y, cable.z]) for cable in robot.cables]
    return next((j + 1 for j in range(robot.n) if j != k and np.array_equal(axes[j], axes[k])), 0)


def _slenderness(points: Positions) -> float:
    """0 for points on one line (or fewer than three), 1 for a round area."""
    values = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return float(values[1] / values[0]) if len(points) > 2 and values[0] > 0 else 0.0


def _numbers(values: np.ndarray) -> str:
    return ", ".join(f"{value:g}" for value in values)
