"""Equilibria and cable tensions (Eq. 8). Tensions are per unit mass (N/kg) unless a mass is given.

`tensions` for a motion that is known; `equilibrium_of_pose` to check and complete a pose at rest; finding such a pose
is in `kinematics`.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from jaxtyping import Float

from fidim_lab.arrays import CableSeries, PerCable, Vector3
from fidim_lab.data.records import Body, Motion, Pose
from fidim_lab.errors import InfeasibleError
from fidim_lab.model.batch import evaluate, from_rows, function, rows
from fidim_lab.model.geometry import rotation_from_gibbs
from fidim_lab.model.mechanism import Mechanism, structure_expression
from fidim_lab.model.regressor import parameter_vector, platform_regressor

NEUTRAL_STIFFNESS = 1e-6
"""of the largest stiffness: a freedom below it is neutral, neither stable nor unstable"""


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """The platform at rest with locked motors, all cables taut, and stable."""

    pose: Pose
    lengths: PerCable
    """m"""
    tensions: PerCable
    """per unit mass, N/kg; positive"""
    stiffness: Float[np.ndarray, " free"]
    """curvature of the potential energy over the free twists, per unit mass, ascending; 0 for a neutral freedom"""

    def tensions_in_newton(self, mass: float) -> PerCable:
        """Cable tensions for a platform of this mass (kg), N."""
        return self.tensions * mass

    def marker_position(self, marker: Vector3) -> Vector3:
        """Where a marker of the body frame rests, world frame, m."""
        return self.pose.position + self.pose.rotation @ marker


def tensions(mechanism: Mechanism, body: Body, motion: Motion) -> tuple[CableSeries, Float[np.ndarray, "N 6"]]:
    """Tensions per unit mass (N/kg) by least squares of Eq. 8, and what is left of the wrench (N/kg, N m/kg).

    W χ′ = −Ξᵀ τ/m has six equations for n tensions: the residual W χ′ + Ξᵀ τ/m is zero in a true free motion.
    Baseline physics only: effects are not subtracted. Raises InfeasibleError at a singular pose.
    """
    wrenches = platform_regressor(motion, mechanism.robot.gravity) @ parameter_vector(body)
    transposed = mechanism.structure_matrix(motion.positions, motion.rotations).transpose(0, 2, 1)
    found = (np.linalg.pinv(transposed) @ -wrenches[..., np.newaxis])[..., 0]
    return found, wrenches + (transposed @ found[..., np.newaxis])[..., 0]


def balance(
    mechanism: Mechanism, body: Body, pose: Pose, tensions_per_mass: PerCable
) -> tuple[Float[np.ndarray, "6"], Float[np.ndarray, "6 6"], Float[np.ndarray, "n 6"], PerCable]:
    """First and second variation of the Lagrangian V/m + τᵀ l/m over small twists, Ξ, and the lengths.

    The first, Ξᵀ τ − φ (N/kg, N m/kg), vanishes at rest; the second (6 × 6), over the free twists, is the free-motion
    stiffness K of Eq. 37.
    """
    compiled = compiled_balance(mechanism)
    gradient, hessian, xi, lengths = evaluate(
        compiled, pose.position, pose.rotation, tensions_per_mass, body.com, mechanism.theta
    )
    return gradient[0], hessian.reshape(6, 6), xi.reshape(-1, 6), lengths[0]


def compiled_balance(mechanism: Mechanism) -> ca.Function:
    """`balance` as a function of columns: position, rotation, tensions, centre of mass, θ."""
    return mechanism.compiled("balance", _compile_balance)


def equilibrium_of_pose(mechanism: Mechanism, body: Body, pose: Pose) -> Equilibrium:
    """The equilibrium that this pose is: its lengths, tensions and stiffness.

    Raises InfeasibleError where the pose is not at rest, a cable would have to push (with its number), or the rest is
    unstable.
    """
    gravity = mechanism.robot.gravity
    xi = mechanism.structure_matrix(pose.position[np.newaxis], pose.rotation[np.newaxis])[0]
    weight = np.concatenate([gravity, np.cross(pose.rotation @ body.com, gravity)])
    held = np.linalg.lstsq(xi.T, weight, rcond=None)[0]
    gradient, hessian, _, lengths = balance(mechanism, body, pose, held)
    if np.abs(gradient).max() > 1e-6 * np.linalg.norm(gravity):
        raise InfeasibleError(f"The pose at {_place(pose)} is not at rest: {np.abs(gradient).max():.1e} N/kg remain.")
    if held.min() <= 0:
        cable = int(np.argmin(held))
        raise InfeasibleError(
            f"No equilibrium at {_place(pose)}: cable {cable + 1} would have to push ({held[cable]:.2f} N/kg).",
            hint="Choose other lengths, nearer to the middle of the workspace.",
        )
    free = np.linalg.svd(xi)[2][len(xi) :].T
    stiffness = np.linalg.eigvalsh(free.T @ hessian @ free)
    neutral = NEUTRAL_STIFFNESS * max(1.0, float(np.abs(stiffness).max()))
    if stiffness.min() < -neutral:
        raise InfeasibleError(f"The equilibrium at {_place(pose)} is unstable: the platform would turn away from it.")
    stiffness = np.where(np.abs(stiffness) <= neutral, 0.0, stiffness)
    return Equilibrium(pose=pose, lengths=lengths, tensions=held, stiffness=stiffness)


def _place(pose: Pose) -> str:
    x, y, z = pose.position
    return f"P = ({x:.3f}, {y:.3f}, {z:.3f}) m"


def _compile_balance(mechanism: Mechanism) -> ca.Function:
    position, flat = ca.SX.sym("position", 3), ca.SX.sym("rotation", 9)
    held, com = ca.SX.sym("tensions", mechanism.n), ca.SX.sym("com", 3)
    theta = ca.SX.sym("theta", mechanism.theta.size)
    step = ca.SX.sym("step", 6)  # [δp; δθ], the rotation being R(δθ/2) R
    turned = rotation_from_gibbs(step[3:] / 2) @ from_rows(flat, 3, 3)
    moved = position + step[:3]
    cables = mechanism.cables_at(moved, turned, theta)
    lengths = mechanism.lengths_at(cables, theta)
    potential = -ca.dot(ca.SX(ca.DM(mechanism.robot.gravity)), moved + turned @ com)
    hessian, gradient = ca.hessian(potential + ca.dot(held, lengths), step)
    outputs = [gradient, rows(hessian), rows(structure_expression(cables)), lengths]
    at_rest = [ca.substitute(output, step, ca.SX.zeros(6)) for output in outputs]
    return function("balance", [position, flat, held, com, theta], at_rest)
