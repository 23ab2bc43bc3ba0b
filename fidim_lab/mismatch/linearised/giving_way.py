"""The effect of yielding dry friction along a fitted motion: its score needs no states.

What has built up in a joint, ḃ = (σ̇ − |σ̇| b) / give, follows from the joint's rate alone. From node to node of the
trajectory's grid the rate is taken as its mean, for which b comes to σ̇/|σ̇| exponentially.
"""

import casadi as ca
import numpy as np
from jaxtyping import Float

from fidim_lab.effects.dissipation.pulley_friction import STILL, SwivelFrictionGivingWay
from fidim_lab.effects.wrenches import joint_rate, joint_torque
from fidim_lab.mismatch.linearised.hypotheses import Hypothesis
from fidim_lab.model.batch import from_rows, function, over_samples, rows
from fidim_lab.model.geometry import CableExpressions
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.integrate import Trajectories
from fidim_lab.model.slots import PlatformState


def holds_of(
    mechanism: Mechanism,
    theta: Float[np.ndarray, " theta"],
    tried: Hypothesis,
    one: Trajectories,
    com: Float[np.ndarray, "3"],
) -> tuple[Float[np.ndarray, "N 3"], Float[np.ndarray, "N 3"]]:
    """Force at the centre of mass and torque beside it, for 1 N m of friction in every swivel, N and N m.

    one: a single window. com: of the platform, body frame, m.
    """
    give = float(tried.absent[1])
    compiled = mechanism.compiled("swivels", _compile_swivels)
    rotations, twists = one.rotations[0], one.twists[0]
    rates, table = over_samples(compiled, len(twists), one.positions[0], rotations, twists, theta)
    built_up = _built_up(rates, np.diff(one.grid.t), give)
    wrench = -np.einsum("kin,kn->ki", table.reshape(len(twists), 6, mechanism.n), built_up)
    force = wrench[:, :3]
    return force, wrench[:, 3:] - np.cross(rotations @ com, force)


def _built_up(rates: Float[np.ndarray, "N n"], steps: Float[np.ndarray, " M"], give: float) -> np.ndarray:
    """b (N n) from nothing, at joint rates (rad/s) and steps of time (s)."""
    mean = (rates[1:] + rates[:-1]) / 2
    size = np.sqrt(mean**2 + STILL**2)
    kept = np.exp(-size * steps[:, np.newaxis] / give)
    gained = mean / size * (1 - kept)
    found = np.zeros_like(rates)
    for k in range(len(steps)):
        found[k + 1] = kept[k] * found[k] + gained[k]
    return found


def _compile_swivels(mechanism: Mechanism) -> ca.Function:
    """(position, rotation row by row, twist, θ) → swivel rates (n), wrench of 1 N m about each (6 n row by row)."""
    position, flat, twist = ca.SX.sym("position", 3), ca.SX.sym("rotation", 9), ca.SX.sym("twist", 6)
    theta = ca.SX.sym("theta", mechanism.theta.size)
    rotation = from_rows(flat, 3, 3)
    cables = mechanism.cables_at(position, rotation, theta)
    state = PlatformState(ca.SX(0), position, rotation, twist, cables)

    def of(cable: CableExpressions) -> tuple[ca.SX, ca.SX]:
        gradient = cable.swivel_gradient
        return joint_rate(state, cable, gradient), joint_torque(cable, gradient, ca.SX(1))

    rates, wrenches = zip(*(of(cable) for cable in cables), strict=True)
    return function("swivels", [position, flat, twist, theta], [ca.vertcat(*rates), rows(ca.horzcat(*wrenches))])


def gives_way(tried: Hypothesis) -> bool:
    """Whether a hypothesis is one whose score is composed here."""
    return isinstance(tried.effect, SwivelFrictionGivingWay)
