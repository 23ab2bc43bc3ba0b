"""Where the platform rests: IPOPT on the potential energy, then Newton's method to full precision.

`pose_from_lengths` treats cables as what they are, lengths not to be exceeded, so that it converges from afar;
whether all of them end up taut is checked afterwards. `equilibrium_at` goes the other way, from place to lengths.
"""

from typing import Any

import casadi as ca
import numpy as np

from fidim_lab.arrays import Matrix3, PerCable, Vector3
from fidim_lab.data.records import Body, Pose, Robot
from fidim_lab.errors import InfeasibleError
from fidim_lab.model.batch import from_rows
from fidim_lab.model.geometry import rotation_from_gibbs, rotation_matrix
from fidim_lab.model.mechanism import Mechanism, structure_expression
from fidim_lab.model.statics import Equilibrium, balance, equilibrium_of_pose

QUIET = {
    "print_time": False,
    "error_on_fail": False,
    "show_eval_warnings": False,
    "calc_lam_p": False,  # not used; where it fails CasADi says so on standard error
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
}

REACHED = 1e-6
"""m between the wanted and the found place of the marker"""


def pose_from_lengths(mechanism: Mechanism, body: Body, lengths: PerCable, start: Pose | None = None) -> Equilibrium:
    """The stable equilibrium at these cable lengths (m), the one reached downhill from `start`.

    Without a start: from the platform unrotated below the middle of the anchors. Minimum of the potential energy with
    every cable at most as long as given. Raises InfeasibleError where a cable hangs slack (with its number), where the
    rest is unstable, or where there is none.
    """
    refusals: list[InfeasibleError] = []
    for begin in _starts(mechanism.robot, lengths) if start is None else [start]:
        try:
            return _rest_below(mechanism, body, lengths, begin)
        except InfeasibleError as refusal:
            refusals.append(refusal)
    raise refusals[0]


def _rest_below(mechanism: Mechanism, body: Body, lengths: PerCable, begin: Pose) -> Equilibrium:
    """The equilibrium downhill from one pose."""
    pose, held = _descended(mechanism, body, lengths, begin)
    actual = mechanism.lengths(pose.position[np.newaxis], pose.rotation[np.newaxis])[0]
    slack = lengths - actual
    if slack.max() > 1e-4:
        cable = int(np.argmax(slack))
        raise InfeasibleError(
            f"Cable {cable + 1} hangs slack at the cable lengths {_metres(lengths)}: "
            f"{slack[cable] * 1e3:.1f} mm to spare.",
            hint=_HINT,
        )
    return equilibrium_of_pose(mechanism, body, _polished(mechanism, body, lengths, pose, held))


def equilibrium_at(
    mechanism: Mechanism, body: Body, marker_position: Vector3, start: Pose | None = None
) -> Equilibrium:
    """An equilibrium with the main marker at this place (world frame, m): its lengths and orientation, for planning.

    With three cables there is one; with four or five, the orientation with the least rotation from the start's
    (unrotated without one; at most 90° about each axis) and evenly shared tension is chosen; with one or two cables
    the places of rest are a point or a curve for each length, and the given one must lie there. Tensions keep to the
    robot's limits.
    Raises InfeasibleError where the platform cannot rest there, with the nearest place where it can.
    """
    robot = mechanism.robot
    reference = np.eye(3) if start is None else start.rotation
    solver = mechanism.compiled("equilibrium at", _compile_placement)
    weight = float(np.linalg.norm(robot.gravity))
    low, high = (limit / robot.mass / weight for limit in robot.limits.tension)
    n = robot.n
    guess = _level_guess(mechanism, body, marker_position, reference)
    found = solver(
        x0=guess,
        p=np.concatenate([reference.ravel(), body.com, marker_position, mechanism.theta]),
        lbx=np.concatenate([np.full(3, -np.inf), np.full(3, -1.0), np.full(n, low)]),
        ubx=np.concatenate([np.full(3, np.inf), np.full(3, 1.0), np.full(n, high)]),
        lbg=0,
        ubg=0,
    )
    answer = np.asarray(found["x"]).ravel()
    pose = Pose(position=answer[:3], rotation=rotation_matrix(answer[3:6]) @ reference)
    place = pose.position + pose.rotation @ robot.marker
    if not solver.stats()["success"]:
        raise InfeasibleError(
            f"The platform cannot rest with its marker at {_metres(marker_position)} and all tensions between "
            f"{robot.limits.tension[0]:g} and {robot.limits.tension[1]:g} N.",
            hint=_HINT,
        )
    if np.linalg.norm(place - marker_position) > REACHED * 10:
        raise InfeasibleError(
            f"The platform cannot rest with its marker at {_metres(marker_position)}; the nearest place is "
            f"{_metres(place)}.",
            hint=f"With {n} cables the places of rest are fewer than the places of the workspace.",
        )
    lengths = mechanism.lengths(pose.position[np.newaxis], pose.rotation[np.newaxis])[0]
    held = answer[6:] * weight
    return equilibrium_of_pose(mechanism, body, _polished(mechanism, body, lengths, pose, held))


_HINT = "Choose lengths or a place nearer to the middle of the workspace."


def _descended(mechanism: Mechanism, body: Body, lengths: PerCable, begin: Pose) -> tuple[Pose, PerCable]:
    """Pose and tensions (N/kg) where the centre of mass is lowest."""
    solver = mechanism.compiled("pose from lengths", _compile_descent)
    parameters = np.concatenate([begin.rotation.ravel(), body.com, mechanism.theta])
    found = solver(x0=np.concatenate([begin.position, np.zeros(3)]), p=parameters, ubg=lengths, lbg=-np.inf)
    if not solver.stats()["success"]:
        raise InfeasibleError(f"No equilibrium found for the cable lengths {_metres(lengths)}.", hint=_HINT)
    answer = np.asarray(found["x"]).ravel()
    pose = Pose(position=answer[:3], rotation=rotation_matrix(answer[3:]) @ begin.rotation)
    return pose, np.asarray(found["lam_g"]).ravel() * float(np.linalg.norm(mechanism.robot.gravity))


def _level_guess(mechanism: Mechanism, body: Body, place: Vector3, reference: Matrix3) -> np.ndarray:
    """The platform unrotated at the place, with the tensions over weight that come nearest to holding it."""
    position = place - reference @ mechanism.robot.marker
    xi = mechanism.structure_matrix(position[np.newaxis], reference[np.newaxis])[0]
    down = mechanism.robot.gravity / np.linalg.norm(mechanism.robot.gravity)
    weight = np.concatenate([down, np.cross(reference @ body.com, down)])
    shares = np.linalg.lstsq(xi.T, weight, rcond=None)[0]
    return np.concatenate([position, np.zeros(3), np.clip(shares, 0.5 / mechanism.n, None)])


def _polished(mechanism: Mechanism, body: Body, lengths: PerCable, pose: Pose, held: PerCable) -> Pose:
    """Newton's method on the stationary Lagrangian; IPOPT leaves some 1e-8."""
    n = mechanism.n
    for _ in range(4):
        gradient, hessian, xi, actual = balance(mechanism, body, pose, held)
        system = np.block([[hessian, xi.T], [xi, np.zeros((n, n))]])
        # least squares: a neutral freedom (a lone cable's swivel, spin about it) leaves the system singular
        step = np.linalg.lstsq(system, -np.concatenate([gradient, actual - lengths]), rcond=1e-10)[0]
        pose = Pose(position=pose.position + step[:3], rotation=rotation_matrix(step[3:6] / 2) @ pose.rotation)
        held = held + step[6:]
    return pose


def _starts(robot: Robot, lengths: PerCable) -> list[Pose]:
    """The platform unrotated below the middle of the anchors: as deep as the lengths let it, then higher and lower."""
    down = robot.gravity / np.linalg.norm(robot.gravity)
    anchors, attachments = np.array([c.d for c in robot.cables]), np.array([c.a for c in robot.cables])
    middle = anchors.mean(axis=0) - attachments.mean(axis=0)
    offsets = anchors - attachments - middle
    sideways = offsets - np.outer(offsets @ down, down)
    depth = np.sqrt(np.maximum(lengths**2 - np.sum(sideways**2, axis=1), 0.01)).mean()
    return [Pose(position=middle + share * depth * down, rotation=np.eye(3)) for share in (1.0, 0.6, 1.5)]


def _metres(values: np.ndarray) -> str:
    return "(" + ", ".join(f"{value:.4g}" for value in values) + ") m"


def _compile_descent(mechanism: Mechanism) -> Any:
    """NLP: height of G over (p, g), R = R(g) R_reference, subject to lengths; multipliers are tensions over weight."""
    unknown, reference = ca.SX.sym("unknown", 6), ca.SX.sym("reference", 9)
    com, theta = ca.SX.sym("com", 3), ca.SX.sym("theta", mechanism.theta.size)
    rotation = rotation_from_gibbs(unknown[3:]) @ from_rows(reference, 3, 3)
    cables = mechanism.cables_at(unknown[:3], rotation, theta)
    down = ca.DM(mechanism.robot.gravity / np.linalg.norm(mechanism.robot.gravity))
    problem = {
        "x": unknown,
        "p": ca.vertcat(reference, com, theta),
        "f": -ca.dot(ca.SX(down), unknown[:3] + rotation @ com),
        "g": mechanism.lengths_at(cables, theta),
    }
    return ca.nlpsol("descent", "ipopt", problem, QUIET)


def _compile_placement(mechanism: Mechanism) -> Any:
    """NLP over (p, g, τ/weight): balance of Eq. 8 at rest, the marker as near as possible, little rotation."""
    n = mechanism.n
    unknown, reference = ca.SX.sym("unknown", 6 + n), ca.SX.sym("reference", 9)
    com, place = ca.SX.sym("com", 3), ca.SX.sym("place", 3)
    theta = ca.SX.sym("theta", mechanism.theta.size)
    gibbs, shares = unknown[3:6], unknown[6:]
    rotation = rotation_from_gibbs(gibbs) @ from_rows(reference, 3, 3)
    cables = mechanism.cables_at(unknown[:3], rotation, theta)
    down = ca.SX(ca.DM(mechanism.robot.gravity / np.linalg.norm(mechanism.robot.gravity)))
    weight = ca.vertcat(down, ca.cross(rotation @ com, down))
    rest = structure_expression(cables).T @ shares - weight
    miss = unknown[:3] + rotation @ ca.SX(ca.DM(mechanism.robot.marker)) - place
    constraints, cost = [rest], ca.sumsqr(gibbs) + 0.1 * ca.sumsqr(shares - ca.sum1(shares) / n)
    if n >= 3:
        constraints.append(miss)
    else:
        cost = ca.sumsqr(miss)
    problem = {
        "x": unknown,
        "p": ca.vertcat(reference, com, place, theta),
        "f": cost,
        "g": ca.vertcat(*constraints),
    }
    return ca.nlpsol("placement", "ipopt", problem, QUIET)
