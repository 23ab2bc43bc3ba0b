"""Standard deviations of a robot file that cannot be meant: each is held against what it is the uncertainty of.

No number is allowed by itself. Two points that are surveyed worse than they are apart could be each other; a camera as
uncertain as the largest swing shows none; one count of an encoder is less than a turn of its motor; a direction that is
uncertain by a radian is unknown. All four mean a unit other than m and rad.
"""

import itertools

import numpy as np

from fidim_lab.app.doctor.finding import RobotFinding
from fidim_lab.arrays import Positions
from fidim_lab.data.records import Robot, Survey

RADIAN = 1.0
"""rad"""


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
