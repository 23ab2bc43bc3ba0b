"""Accelerations and tensions of free motion as compiled functions, with and without derivatives.

Explicit (block elimination), and differentiated through the implicit residual r(x, χ, y) = 0, y = [v̇; τ]:
dy = −K⁻¹ ∂r with K factorised once. In CasADi's virtual machine, four cables: about 7 µs, 40 µs with all derivatives.

Both functions take, per sample, time (s since the window's start), position (3), rotation (9, row by row), moving (6 +
E: the twist and the E states that effects have of their own), constants ([unstretched lengths of the springs; body 9;
θ], the last two being `shared`).

Effects may use the slots for geometry, lengths, drift, wrench, kinetic energy and compliance. Stretch is of first order
(`motion.equations`): exact in the motion and in its derivatives by θ, while its share of the derivatives by the state,
(frequency of motion / frequency of stretch)² of the rest, is left out: a Gauss–Newton step is a little off, its optimum
is not. Mechanism(…, springs=True) makes the stretched cables springs instead (`spring_tensions`): all exact, more
freedoms, nodes as near to each other as the stiffest cable asks for, or quiet ones (`stiff`). What cameras see
is `measurement`'s.

Cables that are springs have their tensions from their stretch (spec/model.md §6).

    stretch = l − l₀ − drift,   τ = stretch/κ + c · d stretch/dt

κ is the effects' compliance, c their damping. Wrong where κ is 0, and stiff where it is small: there the first-order
stretch of rigid cables is right. The lengths l₀ of the unstretched cables are parameters of a window here, while the
rigid model has them in its initial pose alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import casadi as ca

from fidim_lab.errors import OurBugError
from fidim_lab.model.batch import from_rows, function, rows
from fidim_lab.model.geometry import skew
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion.contributions import stretch_dampings
from fidim_lab.model.motion.equations import MotionEquations, Solver, Symbols, motion_equations, saddle
from fidim_lab.model.native import Kernel
from fidim_lab.model.sensitivity.elimination import Elimination
from fidim_lab.model.slots import Effect

BODY = 9
"""entries of `shared` before θ"""

EASE = 0.05
"""N/kg over which a spring's tension fades where it gets slack; at 5 N/kg it adds 1e-4 N/kg, 2e-5 of the stiffness"""


def shared_count(mechanism: Mechanism) -> int:
    """Length of the vector of shared parameters: nine of the body and θ."""
    return BODY + mechanism.theta.size


def sprung(mechanism: Mechanism) -> tuple[int, ...]:
    """Indices (0-based) of the cables that are springs."""
    if not mechanism.springs:
        return ()
    return mechanism.compiled(
        "sensitivity: springs",
        lambda made: tuple(compliant_cables(motion_equations(made, Symbols.of(made)))),
    )


def slopes(mechanism: Mechanism) -> ca.Function:
    """(time, position, rotation, moving, constants) → [v̇; ξ̇; τ] (6 + E + n), with CasADi's derivatives.

    In m/s², rad/s², the units of effects' own states in 1/s, N/kg.
    """
    return mechanism.compiled("sensitivity: slopes", _compile_slopes)


def derivatives(mechanism: Mechanism) -> Kernel:
    """The same inputs → [v̇; ξ̇; τ], and d[v̇; ξ̇] / d[δp; δφ; δv; δω; δξ; constants] row by row.

    Made once for each mechanism; machine code, some time after the first call, for a native one.
    """
    return mechanism.compiled(
        "sensitivity: derivatives", lambda made: Kernel.of(_compile_derivatives(made), native=made.native)
    )


@dataclass(frozen=True, eq=False)
class Sample:
    """Symbols of one sample, its equations of motion, and the solver for them."""

    equations: MotionEquations
    unstretched: ca.SX
    """lengths of the springs, m"""
    shared: ca.SX
    pulled: ca.SX
    """tensions of the springs, N/kg"""
    sprung: tuple[int, ...]
    held: tuple[int, ...]
    """cables that are no springs"""
    solver: Solver
    """for the platform on the cables that are held"""

    @staticmethod
    def of(mechanism: Mechanism, *, springs: bool = True) -> "Sample":
        """Fresh symbols; without `springs` all cables are held, whatever the mechanism says.

        Raises OurBugError for an effect with a slot that is not carried here (see the module).
        """
        refuse_unknown(mechanism)
        chosen = sprung(mechanism) if springs else ()
        held = tuple(k for k in range(mechanism.n) if k not in chosen)
        shared, unstretched = ca.SX.sym("shared", shared_count(mechanism)), ca.SX.sym("unstretched", len(chosen))
        symbols = replace(Symbols.of(mechanism), body=shared[:BODY], theta=shared[BODY:])
        equations = motion_equations(mechanism, symbols)
        pulled = spring_tensions(mechanism, equations, unstretched) if chosen else ca.SX(0, 1)
        # quiet ones are followed by Newton's method, which a slack spring would mislead; slack ends their validity
        pulled = pulled if mechanism.quiet else _only_pulling(pulled)
        solver = _solver(equations, held)
        return Sample(equations, unstretched, shared, pulled, chosen, held, solver)

    @property
    def constants(self) -> ca.SX:
        """[unstretched lengths; shared]."""
        return ca.vertcat(self.unstretched, self.shared)

    @property
    def inputs(self) -> list[ca.SX]:
        """time, position, rotation row by row, [twist; effects' own states], constants."""
        symbols = self.equations.symbols
        return [symbols.time, symbols.position, symbols.flat, self.moving, self.constants]

    @property
    def moving(self) -> ca.SX:
        """[v; ω; ξ]: what has a rate of its own."""
        return ca.vertcat(self.equations.symbols.twist, self.equations.symbols.extra)

    @property
    def structure(self) -> ca.SX:
        """Ξ of the cables that are held."""
        return self.equations.structure[list(self.held), :]

    @property
    def wrench(self) -> ca.SX:
        """With the pull of the springs and what grows with it (6)."""
        return self.equations.wrench + self.equations.wrench_of(self.sprung, self.pulled)

    @property
    def pull(self) -> ca.SX:
        """l̈ − Ξ̇ v of the cables that are held."""
        return entries(self.equations.pull, self.held)

    @property
    def first_order(self) -> bool:
        """Whether held cables stretch to first order."""
        return not self.sprung and not self.equations.compliance.is_zero()

    def solve(self) -> ca.SX:
        """[v̇; tensions of the cables that are held]."""
        return self.equations.solve(self.solver) if self.first_order else self.solver(self.wrench, self.pull)

    def outputs(self, solution: ca.SX) -> ca.SX:
        """[v̇; ξ̇; τ of all cables] of a solution."""
        tensions = ca.SX.zeros(self.equations.structure.size1())
        tensions[list(self.sprung)] = self.pulled
        tensions[list(self.held)] = solution[6:]
        return ca.vertcat(solution[:6], self.equations.extra_rates, tensions)

    def residual(self, solution: ca.SX) -> ca.SX:
        """[(M + A) v̇ + (Ξᵀ − W) τ − Y τ² − f; Ξ v̇ − c], zero for the solution."""
        rates, tensions = solution[:6], solution[6:]
        return ca.vertcat(
            self.equations.mass @ rates - self.equations.wrench_of(self.held, tensions) - self.wrench,
            self.structure @ rates - self.pull,
        )


def entries(column: ca.SX, chosen: Sequence[int]) -> ca.SX:
    """Some entries of a column, as a column even where there are none."""
    return ca.vertcat(ca.SX(0, 1), *(column[k] for k in chosen))


def refuse_unknown(mechanism: Mechanism) -> None:
    """Raise OurBugError for what trajectories with derivatives do not carry: cameras that see an extra state change."""
    for effect in mechanism.effects:
        made = type(effect)
        if effect.extra_states and made.seen is not Effect.seen and made.extra_rates is not Effect.extra_rates:
            raise OurBugError(
                f"{made.__name__}: trajectories with derivatives do not show changing extra states to the cameras.",
                hint="Simulate it with model.motion.dynamics, or score it with model.motion.forcing.",
            )


def turned(flat: ca.SX) -> ca.SX:
    """d(rotation row by row)/dδφ (9 × 3) for R → R exp([δφ]×)."""
    rotation = from_rows(flat, 3, 3)
    return ca.horzcat(*(rows(rotation @ skew(ca.SX(ca.DM.eye(3)[:, axis]))) for axis in range(3)))


def _only_pulling(tensions: ca.SX) -> ca.SX:
    """A spring's cable hangs slack rather than push: the positive part, rounded off over EASE."""
    return (tensions + ca.sqrt(tensions**2 + EASE**2)) / 2


def _solver(equations: MotionEquations, held: tuple[int, ...]) -> Solver:
    structure, by_tension = equations.structure[list(held), :], equations.by_tension[:, list(held)]
    if equations.added_mass.is_zero() and by_tension.is_zero():
        return Elimination.of(equations.body, structure).solve
    return saddle(equations.mass, structure, by_tension)


def _compile_slopes(mechanism: Mechanism) -> ca.Function:
    sample = Sample.of(mechanism)
    return function("slopes", sample.inputs, _shortened(sample, [sample.outputs(sample.solve())]))


def _compile_derivatives(mechanism: Mechanism) -> ca.Function:
    sample = Sample.of(mechanism)
    symbols = sample.equations.symbols
    solution, unknown = sample.solve(), ca.SX.sym("y", 6 + len(sample.held))
    # one sweep for all columns: the entries of the rotation first, then the three directions in which it can turn
    at = ca.vertcat(symbols.position, symbols.flat, sample.moving, sample.constants)
    jacobian = ca.jacobian(sample.residual(unknown), at)
    if sample.first_order:
        bend = sample.equations.stretch(sample.solver)[2]
        jacobian[6:, -symbols.theta.numel() :] -= ca.jacobian(bend, symbols.theta)
    change = ca.substitute(_by_directions(symbols, jacobian), unknown, solution)
    moved = sample.solver(-change[:6, :], -change[6:, :])[:6, :]
    if symbols.extra.numel():
        moved = ca.vertcat(moved, _by_directions(symbols, ca.jacobian(sample.equations.extra_rates, at)))
    outputs = [sample.outputs(solution), rows(moved)]
    return function("slope_derivatives", sample.inputs, _shortened(sample, outputs))


def _by_directions(symbols: Symbols, jacobian: ca.SX) -> ca.SX:
    """Nine columns by the entries of the rotation made into three by the directions in which it can turn."""
    return ca.horzcat(jacobian[:, :3], jacobian[:, 3:12] @ turned(symbols.flat), jacobian[:, 12:])


def _shortened(sample: Sample, outputs: list[ca.SX]) -> list[ca.SX]:
    """Common parts of the long expressions of stretch computed once."""
    return ca.cse(outputs) if sample.first_order or sample.sprung else outputs


def compliant_cables(equations: MotionEquations) -> list[int]:
    """Indices (0-based) of the cables that effects stretch."""
    return [k for k in range(equations.structure.size1()) if not equations.compliance[k].is_zero()]


def spring_tensions(mechanism: Mechanism, equations: MotionEquations, lengths: ca.SX) -> ca.SX:
    """Tensions, N/kg, of the compliant cables alone, whose unstretched `lengths` (as many, m) are given."""
    compliant = compliant_cables(equations)
    if not compliant:
        return ca.SX(0, 1)
    stretch = (equations.lengths - equations.drifts)[compliant] - lengths
    drift_rates = ca.jtimes(equations.drifts, equations.symbols.time, ca.SX(1))
    rate = (equations.structure @ equations.symbols.twist - drift_rates)[compliant]
    dampings = stretch_dampings(mechanism, equations.state.cables, equations.symbols.theta)
    return stretch / equations.compliance[compliant] + ca.vertcat(*(dampings[k] for k in compliant)) * rate
