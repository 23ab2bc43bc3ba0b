"""What the checks of a robot file find: of its cables, of the order of its attachments, of its stated uncertainties.

Where a robot cannot rest, one mistake is taken back at a time. Only what people do is tried: attachments in another
order than the anchors, gravity along another axis or upwards, attachments measured from the other side of P.

Standard deviations are held against what they are the uncertainty of, since no number is wrong by itself. Two points
that are surveyed worse than they are apart could be each other; a camera as uncertain as the largest swing shows none;
one count of an encoder is less than a turn of its motor; a direction that is uncertain by a radian is unknown. All four
mean a unit other than m and rad.
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations, permutations
from typing import NamedTuple

import numpy as np

from fidim_lab.arrays import PerCable, Positions
from fidim_lab.data.records import Robot, Survey
from fidim_lab.errors import InfeasibleError
from fidim_lab.identification.workspace import Workspace, rest_near
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.statics import Equilibrium

RADIAN = 1.0
"""rad"""


DEPTHS = (0.3, 0.5, 0.7, 0.9)
"""under the middle of the anchors, in the workspace's scale: all must do, for a wrong robot may rest at some"""
DOWN = np.array([0.0, 0.0, -9.81])


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


class RobotFinding(NamedTuple):
    """One check. A finding that is fine and still has advice is a warning: such a robot exists, but mind this."""

    what: str
    ok: bool
    found: str
    """a sentence with numbers"""
    advice: str = ""
    """what to do; a warning where `ok`"""


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


def uncertainties(robot: Robot) -> RobotFinding:
    """[sensors] and [survey] in m and rad."""
    wrong = [*_sensors(robot), *(() if robot.survey is None else _survey(robot, robot.survey))]
    if wrong:
        found = f"{'; '.join(wrong)}."
        advice = "Standard deviations are in m and rad: 0.1 mm is 1e-4, 5 mrad 5e-3."
        return RobotFinding("uncertainties", False, found, advice)
    noise, count = 1e3 * robot.sensors.marker_noise, 1e3 * robot.sensors.encoder_resolution
    return RobotFinding(
        "uncertainties", True, f"Markers are good to {noise:.3g} mm, a count is {count:.2g} mm of cable."
    )


def _sensors(robot: Robot) -> list[str]:
    wrong = []
    noise, swing = robot.sensors.marker_noise, max(robot.limits.free_displacement)
    if noise >= swing / np.sqrt(2.0):  # rms of the largest swing
        wrong.append(f"sensors, marker_noise is {noise:g} m, and the largest swing that limits allow {swing:g} m")
    turns = [2.0 * np.pi * one.drum_radius / one.gear_ratio for one in robot.winches or ()]
    count = robot.sensors.encoder_resolution
    if turns and count >= min(turns):
        wrong.append(f"sensors, encoder_resolution is {count:g} m, and a turn of the motor {min(turns):.3g} m of cable")
    return wrong


def _survey(robot: Robot, survey: Survey) -> list[str]:
    anchors, attachments = (np.array([getattr(cable, key) for cable in robot.cables]) for key in ("d", "a"))
    reach = float(np.linalg.norm(anchors - anchors.mean(axis=0), axis=1).max())
    lengths = {
        "anchor": (float(survey.anchor.max()), _nearest(anchors), "two anchors are"),
        "attachment": (float(survey.attachment.max()), _nearest(attachments), "two attachments are"),
        "marker": (survey.marker, _nearest(robot.markers), "two markers are"),
        "encoder_zero": (survey.encoder_zero, reach, "an anchor, from the middle of all,"),
        "frame_shift": (survey.frame_shift, reach, "an anchor, from the middle of all,"),
    }
    said = [
        f"survey, {key} is {sd:g} m, and {what} {size:.3g} m apart"
        for key, (sd, size, what) in lengths.items()
        if sd >= size
    ]
    pulley = max(cable.radius for cable in robot.cables)
    if pulley and survey.radius >= pulley:
        said.append(f"survey, radius is {survey.radius:g} m, and the largest pulley {pulley:g} m")
    angles = {key: getattr(survey, key) for key in ("axis", "frame_rotation", "gravity")}
    return said + [f"survey, {key} is {sd:g} rad" for key, sd in angles.items() if sd >= RADIAN]


def _nearest(points: Positions) -> float:
    """m between the two nearest points; endless for one point, and for those at one place."""
    apart = [float(np.linalg.norm(a - b)) for a, b in itertools.combinations(points, 2)]
    return min((distance for distance in apart if distance > 0.0), default=np.inf)
