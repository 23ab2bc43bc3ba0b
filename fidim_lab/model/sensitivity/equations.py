"""Accelerations and tensions of free motion as compiled functions, with and without derivatives.

Explicit (block elimination), and differentiated through the implicit residual r(x, χ, y) = 0, y = [v̇; τ]:
dy = −K⁻¹ ∂r with K factorised once. In CasADi's virtual machine, four cables: about 7 µs, 40 µs with all derivatives.

Both functions take, per sample, time (s since the window's start), position (3), rotation (9, row by row), twist (6),
shared ([body 9; θ]).
"""

from dataclasses import dataclass

import casadi as ca

from fidim_lab.model.batch import from_rows, function, rows
from fidim_lab.model.geometry import skew
from fidim_lab.model.mechanism import Mechanism, structure_expression, structure_rate_expression
from fidim_lab.model.native import built
from fidim_lab.model.rigid_body import BodyExpressions
from fidim_lab.model.sensitivity.elimination import Elimination
from fidim_lab.model.slots import PlatformState

BODY = 9
"""entries of `shared` before θ"""


def shared_count(mechanism: Mechanism) -> int:
    """Length of the vector of shared parameters: nine of the body and θ."""
    return BODY + mechanism.theta.size


def slopes(mechanism: Mechanism) -> ca.Function:
    """(time, position, rotation, twist, shared) → [v̇; τ] (6 + n): m/s², rad/s², N/kg. With CasADi's derivatives."""
    return mechanism.compiled("sensitivity: slopes", _compile_slopes)


def derivatives(mechanism: Mechanism) -> ca.Function:
    """The same inputs → [v̇; τ], and d v̇ / d[δp; δφ; δv; δω; shared] row by row (6 × (12 + shared)).

    Made once for each mechanism; machine code for a native one.
    """
    return mechanism.compiled(
        "sensitivity: derivatives",
        lambda made: built(_compile_derivatives(made)) if made.native else _compile_derivatives(made),
    )


@dataclass(frozen=True, eq=False)
class _Motion:
    """Symbols of one sample and the system that its accelerations solve."""

    time: ca.SX
    position: ca.SX
    rotation: ca.SX
    """9, row by row"""
    twist: ca.SX
    shared: ca.SX
    structure: ca.SX
    system: Elimination
    body: BodyExpressions
    wrench: ca.SX
    """everything but inertia and cables: φ − C v + effects (6)"""
    pull: ca.SX
    """−Ξ̇ v (n)"""

    @property
    def inputs(self) -> list[ca.SX]:
        return [self.time, self.position, self.rotation, self.twist, self.shared]

    @property
    def solution(self) -> ca.SX:
        return self.system.solve(self.wrench, self.pull)

    def residual(self, solution: ca.SX) -> ca.SX:
        """[M v̇ + Ξᵀ τ − f; Ξ v̇ + Ξ̇ v], zero for the solution."""
        rates, tensions = solution[:6], solution[6:]
        return ca.vertcat(
            self.body.mass_matrix @ rates + self.structure.T @ tensions - self.wrench,
            self.structure @ rates - self.pull,
        )


def _motion(mechanism: Mechanism) -> _Motion:
    time, position, flat = ca.SX.sym("time"), ca.SX.sym("position", 3), ca.SX.sym("rotation", 9)
    twist, shared = ca.SX.sym("twist", 6), ca.SX.sym("shared", shared_count(mechanism))
    theta, rotation = shared[BODY:], from_rows(flat, 3, 3)
    cables = mechanism.cables_at(position, rotation, theta)
    body = BodyExpressions.of(shared[:BODY], rotation)
    structure = structure_expression(cables)
    rate = structure_rate_expression(structure, position, rotation, twist)
    state = PlatformState(time=time, position=position, rotation=rotation, twist=twist, cables=cables)
    wrench = body.gravity_wrench(mechanism.robot.gravity) - body.gyroscopic(twist[3:])
    wrench += mechanism.wrench_at(state, theta)
    system = Elimination.of(body, structure)
    return _Motion(time, position, flat, twist, shared, structure, system, body, wrench, -rate @ twist)


def turned(flat: ca.SX) -> ca.SX:
    """d(rotation row by row)/dδφ (9 × 3) for R → R exp([δφ]×)."""
    rotation = from_rows(flat, 3, 3)
    return ca.horzcat(*(rows(rotation @ skew(ca.SX(ca.DM.eye(3)[:, axis]))) for axis in range(3)))


def _compile_slopes(mechanism: Mechanism) -> ca.Function:
    motion = _motion(mechanism)
    return function("slopes", motion.inputs, [motion.solution])


def _compile_derivatives(mechanism: Mechanism) -> ca.Function:
    motion = _motion(mechanism)
    solution, unknown = motion.solution, ca.SX.sym("y", 6 + mechanism.n)
    residual = motion.residual(unknown)
    # one sweep for all columns: the entries of the rotation first, then the three directions in which it can turn
    at = ca.vertcat(motion.position, motion.rotation, motion.twist, motion.shared)
    jacobian = ca.jacobian(residual, at)
    by_rotation = jacobian[:, 3:12] @ turned(motion.rotation)
    by_state = [jacobian[:, :3], by_rotation, jacobian[:, 12:]]
    change = ca.substitute(ca.horzcat(*by_state), unknown, solution)
    moved = motion.system.solve(-change[:6, :], -change[6:, :])
    return function("slope_derivatives", motion.inputs, [solution, rows(moved[:6, :])])
