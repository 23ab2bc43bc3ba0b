"""The force of a unit of loose mass inside the platform, along a fitted motion: its score needs no states.

At m = 0 the mass does not move the platform: its own motion is that of a damped pendulum whose support is known. With
d = q − H its place against the point H where it is held (`effects.loose_mass`), d̈ + 2 ζ ω ḋ + ω² d = g − Ḧ from rest,
and a kilogram of it pulls ω² d + 2 ζ ω ḋ at H. Solved by collocation on the blocks of the trajectory's grid, as the
variational equation is.
"""

import casadi as ca
import numpy as np
from jaxtyping import Float

from fidim_lab.mismatch.linearised.hypotheses import Hypothesis
from fidim_lab.model.sensitivity.grid import Grid
from fidim_lab.model.sensitivity.integrate import Trajectories
from fidim_lab.model.slots import Effect, PlatformState


class UnitTorque(Effect):
    """A torque θ (3) on the platform, N m, world frame."""

    parameters = ("x", "y", "z")

    def wrench(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """[0; θ]."""
        return ca.vertcat(ca.SX.zeros(3), theta)


def pull_of(
    tried: Hypothesis, one: Trajectories, com: Float[np.ndarray, "3"], gravity: Float[np.ndarray, "3"]
) -> tuple[Float[np.ndarray, "N 3"], Float[np.ndarray, "N 3"]]:
    """Force at the centre of mass and torque beside it, for 1 kg at the scan point of the hypothesis, N and N m.

    one: a single window. com: of the platform, body frame, m.
    """
    _, frequency, damping, *place = tried.absent
    rotations, spins = one.rotations[0], one.twists[0, :, 3:]
    arms = rotations @ np.array(place)
    support = one.accelerations[0, :, :3] + np.cross(one.accelerations[0, :, 3:], arms)
    support += np.cross(spins, np.cross(spins, arms))
    force = _filtered(gravity - support, one.grid, 2 * np.pi * frequency, damping, gravity)
    return force, np.cross(arms - rotations @ com, force)


def _filtered(
    driving: Float[np.ndarray, "N 3"], grid: Grid, pulsation: float, damping: float, gravity: np.ndarray
) -> Float[np.ndarray, "N 3"]:
    """ω² d + 2 ζ ω ḋ of d̈ + 2 ζ ω ḋ + ω² d = driving at the nodes; at first d hangs at rest."""
    k, quadrature = grid.resolution.intervals, grid.quadrature[1:]
    rates = np.array([[0.0, 1.0], [-(pulsation**2), -2 * damping * pulsation]])
    implicit = np.linalg.inv(np.eye(2 * k) - np.kron(quadrature[:, 1:], rates))
    carried = implicit @ (np.tile(np.eye(2), (k, 1)) + np.kron(quadrature[:, :1], rates))
    driven = implicit @ np.kron(quadrature, np.array([[0.0], [1.0]]))
    index = np.arange(grid.blocks)[:, np.newaxis] * k + np.arange(k + 1)
    forced = driven @ driving[index]
    state = np.stack([gravity / pulsation**2, np.zeros(3)])
    found = [state[np.newaxis]]
    for block in forced:
        inner = (carried @ state + block).reshape(k, 2, 3)
        found.append(inner)
        state = inner[-1]
    course = np.concatenate(found)
    return pulsation**2 * course[:, 0] + 2 * damping * pulsation * course[:, 1]
