"""Accelerations and tensions of free motion as compiled functions, with and without derivatives.

Explicit (block elimination), and differentiated through the implicit residual r(x, χ, y) = 0, y = [v̇; τ]:
dy = −K⁻¹ ∂r with K factorised once. In CasADi's virtual machine, four cables: about 7 µs, 40 µs with all derivatives.

Both functions take, per sample, time (s since the window's start), position (3), rotation (9, row by row), twist (6),
shared ([body 9; θ]).

Effects may use the slots for geometry, lengths, drift, wrench, kinetic energy and compliance. Stretch is of first order
(`model.equations`): exact in the motion and in its derivatives by θ, while its share of the derivatives by the state,
(frequency of motion / frequency of stretch)² of the rest, is left out: a Gauss–Newton step is a little off, its optimum
is not. States of their own are not carried (`refuse_unknown`); what cameras see is `measurement`'s.
"""

from dataclasses import dataclass, replace

import casadi as ca

from fidim_lab.errors import OurBugError
from fidim_lab.model.batch import from_rows, function, rows
from fidim_lab.model.equations import MotionEquations, Solver, Symbols, motion_equations
from fidim_lab.model.geometry import skew
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.native import built
from fidim_lab.model.sensitivity.elimination import Elimination

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
class Sample:
    """Symbols of one sample, its equations of motion, and the solver for them."""

    equations: MotionEquations
    shared: ca.SX
    solver: Solver

    @staticmethod
    def of(mechanism: Mechanism) -> "Sample":
        """Fresh symbols. Raises OurBugError for an effect with a slot that is not carried here (see the module)."""
        refuse_unknown(mechanism)
        shared = ca.SX.sym("shared", shared_count(mechanism))
        symbols = replace(Symbols.of(mechanism), body=shared[:BODY], theta=shared[BODY:])
        equations = motion_equations(mechanism, symbols)
        if equations.added_mass.is_zero():
            return Sample(equations, shared, Elimination.of(equations.body, equations.structure).solve)
        return Sample(equations, shared, equations.factorised())

    @property
    def inputs(self) -> list[ca.SX]:
        """time, position, rotation row by row, twist, shared."""
        symbols = self.equations.symbols
        return [symbols.time, symbols.position, symbols.flat, symbols.twist, self.shared]

    def residual(self, solution: ca.SX) -> ca.SX:
        """[(M + A) v̇ + Ξᵀ τ − f; Ξ v̇ − c], zero for the solution."""
        rates, tensions = solution[:6], solution[6:]
        return ca.vertcat(
            self.equations.mass @ rates + self.equations.structure.T @ tensions - self.equations.wrench,
            self.equations.structure @ rates - self.equations.pull,
        )


def refuse_unknown(mechanism: Mechanism) -> None:
    """Raise OurBugError for an effect that uses a slot which trajectories with derivatives do not carry (yet)."""
    for effect in mechanism.effects:
        if effect.extra_states:
            raise OurBugError(
                f"{type(effect).__name__}: trajectories with derivatives do not know its slot extra_states.",
                hint="Simulate it with model.dynamics, or score it with model.forcing.",
            )


def turned(flat: ca.SX) -> ca.SX:
    """d(rotation row by row)/dδφ (9 × 3) for R → R exp([δφ]×)."""
    rotation = from_rows(flat, 3, 3)
    return ca.horzcat(*(rows(rotation @ skew(ca.SX(ca.DM.eye(3)[:, axis]))) for axis in range(3)))


def _compile_slopes(mechanism: Mechanism) -> ca.Function:
    sample = Sample.of(mechanism)
    return function("slopes", sample.inputs, _shortened(sample, [sample.equations.solve(sample.solver)]))


def _compile_derivatives(mechanism: Mechanism) -> ca.Function:
    sample = Sample.of(mechanism)
    symbols = sample.equations.symbols
    solution, unknown = sample.equations.solve(sample.solver), ca.SX.sym("y", 6 + mechanism.n)
    # one sweep for all columns: the entries of the rotation first, then the three directions in which it can turn
    at = ca.vertcat(symbols.position, symbols.flat, symbols.twist, sample.shared)
    jacobian = ca.jacobian(sample.residual(unknown), at)
    if not sample.equations.compliance.is_zero():
        bend = sample.equations.stretch(sample.solver)[2]
        jacobian[6:, -symbols.theta.numel() :] -= ca.jacobian(bend, symbols.theta)
    by_rotation = jacobian[:, 3:12] @ turned(symbols.flat)
    by_state = ca.horzcat(jacobian[:, :3], by_rotation, jacobian[:, 12:])
    change = ca.substitute(by_state, unknown, solution)
    moved = sample.solver(-change[:6, :], -change[6:, :])
    return function("slope_derivatives", sample.inputs, _shortened(sample, [solution, rows(moved[:6, :])]))


def _shortened(sample: Sample, outputs: list[ca.SX]) -> list[ca.SX]:
    """Common parts of the long expressions of stretch computed once."""
    return outputs if sample.equations.compliance.is_zero() else ca.cse(outputs)
