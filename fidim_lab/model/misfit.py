"""Markers held against cable lengths while the platform moves: by how much must cables be longer than was told?

What hangs at cables cannot be farther away than they reach, and a taut cable is not shorter, either. Where markers and
lengths leave the platform no pose, the one that fits best tells the least error of the lengths.
"""

from collections.abc import Callable

import casadi as ca
import numpy as np
from jaxtyping import Float

from fidim_lab.arrays import Mask, PerCable, Positions
from fidim_lab.data.records import Pose
from fidim_lab.model.batch import evaluate, from_rows, function, rows
from fidim_lab.model.geometry import rotation_from_gibbs, skew
from fidim_lab.model.mechanism import Mechanism, structure_expression

FREEDOMS = {0: 0, 1: 3, 2: 5}
"""of a pose that so many markers fix; more fix all six"""
STIFF = 30.0
"""weight of a metre of a marker against one of cable: a marker gives way by 1e-3 of what the lengths are off"""
DAMPING = 3e-3
"""m/rad (and m/m): turns that no cable and no marker shows are not taken"""
RANK = 1e-6
"""of a singular value (m): below it there is none"""
STEPS = 2
"""of Gauss-Newton in a call: from one look to the next one is enough"""
CALLS, DONE = 12, 2e-5
"""calls at most, until what is left changes by less (m)"""

Misfit = Callable[[Positions, PerCable, Mask, Pose], tuple[PerCable, Pose]]


def redundancy(cables: int, markers: int) -> int:
    """How many cable lengths so many seen markers foretell: nothing can be told by 0 or less."""
    return cables + FREEDOMS.get(markers, 6) - 6


def foretold(mechanism: Mechanism, pose: Pose) -> Float[np.ndarray, "n n"]:
    """The projection of errors of the cables' lengths (m) onto what of them shows against all markers, at a pose.

    What turns about the markers can take up does not show. Raises InfeasibleError at a singular pose.
    """
    structure = mechanism.structure_matrix(pose.position[np.newaxis], pose.rotation[np.newaxis])[0]
    arms = mechanism.robot.markers @ pose.rotation.T
    seen = np.vstack([np.hstack([np.eye(3), -np.cross(arm, np.eye(3)).T]) for arm in arms])
    _, sizes, ways = np.linalg.svd(seen)
    free = structure @ ways[int((sizes > RANK).sum()) :].T
    return np.eye(mechanism.n) - free @ np.linalg.pinv(free, rcond=RANK)


def length_misfit(mechanism: Mechanism) -> Misfit:
    """What tells it for a robot, in some 0.2 ms.

    (M, 3) markers seen (world, m; NaN where not), lengths told (m), which cables are taut, a pose near by → m by which
    each cable is longer than told (a taut one also shorter, negative), by least squares, and the pose that fits best.
    """
    points = mechanism.robot.markers
    step = mechanism.compiled("misfit", lambda made: _compile(made, points))

    def misfit(seen: Positions, lengths: PerCable, taut: Mask, start: Pose) -> tuple[PerCable, Pose]:
        weights = np.where(np.isnan(seen).any(axis=1), 0.0, STIFF)
        given = (np.nan_to_num(seen).ravel(), weights, np.asarray(lengths, dtype=float), taut.astype(float))
        state, off, left = np.concatenate([start.position, start.rotation.ravel()]), np.zeros(len(lengths)), np.inf
        for _ in range(CALLS):
            found, longer = evaluate(step, state, *given, mechanism.theta)
            state, off = found[0], longer[0]
            before, left = left, float(np.linalg.norm(off))
            if abs(left - before) < DONE:
                break
        return off, Pose(state[:3], state[3:].reshape(3, 3))

    return misfit


def _compile(mechanism: Mechanism, points: Positions) -> ca.Function:
    """(pose, markers, their weights, lengths, taut, θ) → (pose, what is left of each cable)."""
    count, n = len(points), mechanism.n
    state, seen, weights = ca.SX.sym("pose", 12), ca.SX.sym("seen", 3 * count), ca.SX.sym("weights", count)
    lengths, taut = ca.SX.sym("lengths", n), ca.SX.sym("taut", n)
    theta = ca.SX.sym("theta", mechanism.theta.size)
    given = [seen, weights, lengths, taut, theta]
    position, rotation = state[:3], from_rows(state[3:], 3, 3)
    cables = mechanism.cables_at(position, rotation, theta)
    longer = mechanism.lengths_at(cables, theta) - lengths
    counts = ca.fmax(taut, longer > 0)
    blocks, left = [ca.diag(counts) @ structure_expression(cables)], [counts * longer]
    for k, point in enumerate(points):
        arm = rotation @ ca.DM(point)
        blocks.append(weights[k] * ca.horzcat(ca.SX.eye(3), -skew(arm)))
        left.append(weights[k] * (position + arm - seen[3 * k : 3 * k + 3]))
    jacobian, missed = ca.vertcat(*blocks), ca.vertcat(*left)
    normal = jacobian.T @ jacobian + DAMPING**2 * ca.SX.eye(6)
    step = ca.solve(normal, -jacobian.T @ missed)
    moved = ca.vertcat(position + step[:3], rows(rotation_from_gibbs(step[3:] / 2) @ rotation))
    once = ca.Function("once", [state, *given], [moved, counts * longer])
    found: ca.SX = state
    for _ in range(STEPS):
        found = once(found, *given)[0]
    return function("misfit", [state, *given], [found, once(found, *given)[1]])
