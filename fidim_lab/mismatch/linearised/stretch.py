"""The effect of a unit of compliance along a rigid motion: cable lengths that follow their tension.

The stretch is κ(pose) τ(t) with the tension of the motion as simulated; time derivatives are taken of the polynomials
through the nodes of each block, so no expression of the accelerations is differentiated twice.
"""

from functools import cache

import casadi as ca
import numpy as np
from jaxtyping import Float

from fidim_lab.effects.effect import NamedEffect
from fidim_lab.model.batch import from_rows, function, over_samples, rows
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.grid import Resolution, lobatto
from fidim_lab.model.sensitivity.integrate import Trajectories
from fidim_lab.model.slots import PlatformState

Stretch = Float[np.ndarray, "3 N n"]
"""stretch (m), its rate and its second derivative at the nodes, for one cable each"""


def stretch_of(
    mechanism: Mechanism, theta: Float[np.ndarray, " theta"], effect: NamedEffect, trajectories: Trajectories
) -> Stretch:
    """The stretch of all cables for θ = 1 along the first window of the trajectories, with two time derivatives."""
    nodes = trajectories.positions.shape[1]
    compiled = mechanism.compiled(f"unit compliance: {effect!r}", lambda made: _compile(made, effect))
    found = over_samples(compiled, nodes, trajectories.positions[0], trajectories.rotations[0], theta)[0]
    stretch = found * mechanism.robot.mass * trajectories.tensions[0]
    rate = _derivative(stretch, trajectories.grid.resolution)
    return np.stack([stretch, rate, _derivative(rate, trajectories.grid.resolution)])


def pushes_of(
    mechanism: Mechanism,
    theta: Float[np.ndarray, " theta"],
    effect: NamedEffect,
    trajectories: Trajectories,
    com: Float[np.ndarray, "3"],
) -> tuple[Float[np.ndarray, "N 3"], Float[np.ndarray, "N 3"]]:
    """Force at the centre of mass and torque beside it that entry points which yield add for θ = 1, N and N m.

    com: of the platform, body frame, m.
    """
    nodes, n = trajectories.positions.shape[1], mechanism.n
    compiled = mechanism.compiled(f"unit yielding: {effect!r}", lambda made: _compile_yielding(made, effect))
    found = over_samples(compiled, nodes, trajectories.positions[0], trajectories.rotations[0], theta)[0]
    tensions = mechanism.robot.mass * trajectories.tensions[0]
    wrench = np.einsum("kin,kn->ki", found.reshape(nodes, 6, n), tensions**2) / 2
    return wrench[:, :3], wrench[:, 3:] - np.cross(trajectories.rotations[0] @ com, wrench[:, :3])


def _compile_yielding(mechanism: Mechanism, effect: NamedEffect) -> ca.Function:
    position, flat, twist = ca.SX.sym("position", 3), ca.SX.sym("rotation", 9), ca.SX.sym("twist", 6)
    theta = ca.SX.sym("theta", mechanism.theta.size)
    rotation = from_rows(flat, 3, 3)
    cables = mechanism.cables_at(position, rotation, theta)
    state = PlatformState(ca.SX(0), position, rotation, twist, cables)
    each = [state.gradient(effect.compliance(k, cable, ca.SX(1))) for k, cable in enumerate(cables, start=1)]
    return function("unit_yielding", [position, flat, theta], [rows(ca.horzcat(*each))])


def _compile(mechanism: Mechanism, effect: NamedEffect) -> ca.Function:
    position, flat = ca.SX.sym("position", 3), ca.SX.sym("rotation", 9)
    theta = ca.SX.sym("theta", mechanism.theta.size)
    cables = mechanism.cables_at(position, from_rows(flat, 3, 3), theta)
    one = ca.SX(1)
    each = [effect.compliance(number, cable, one) for number, cable in enumerate(cables, start=1)]
    return function("unit_compliance", [position, flat, theta], [ca.vertcat(*each)])


def _derivative(values: Float[np.ndarray, "N n"], resolution: Resolution) -> Float[np.ndarray, "N n"]:
    """d/dt at the nodes, block by block; where two blocks meet, the mean of both."""
    k = resolution.intervals
    blocks = (len(values) - 1) // k
    index = np.arange(blocks)[:, np.newaxis] * k + np.arange(k + 1)
    slopes = _differentiation(k) @ values[index] / resolution.block
    total, weight = np.zeros_like(values), np.zeros((len(values), 1))
    np.add.at(total, index, slopes)
    np.add.at(weight, index, 1.0)
    return total / weight


@cache
def _differentiation(intervals: int) -> Float[np.ndarray, "k+1 k+1"]:
    """Derivatives at the Lobatto nodes of [0, 1] of the polynomial through values there."""
    x = 2 * lobatto(intervals)[0] - 1
    values = np.polynomial.legendre.legvander(x, intervals)
    slopes = np.stack(
        [np.polynomial.legendre.legval(x, np.polynomial.legendre.legder(row)) for row in np.eye(intervals + 1)], axis=1
    )
    matrix = 2 * slopes @ np.linalg.inv(values)
    matrix.setflags(write=False)
    return matrix
