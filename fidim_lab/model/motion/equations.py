"""The completed model's equations of motion: free motion with locked motors and everything that effects add to it.

    (M + A) v̇ + (Ξᵀ − W) τ − Y τ² = φ − C v + w − b    per unit mass, τ in N/kg; W what effects do for each newton of
                                                        tension, Y = ½ ∂κ of entry points that yield (κ below)
    Ξ v̇ + Ξ̇ v = l̈,    l = l₀ + drift(t) + stretch
    ξ̇ = the extra states' own rates

Two ways to treat compliant cables, by their stiffness and what is asked:

first order   `MotionEquations.solve`: the stretch κ τ of each cable follows the tension that the rigid robot would have
              in the same state, σ(t, pose, twist, ξ) = κ τ_rigid, and l̈ gets σ̈, its second derivative along the rigid
              robot's motion. Exact derivatives by the compliance at 0, which is what a score needs; cables hold no
              energy of their own, so nothing is stiff and the λ freedoms stay λ. The error is of second order: relative
              to the effect about (slowest frequency of stretch / frequency of motion)⁻².
              That adds up in phase: refits of whole windows need springs.
springs       `elastic`: τ = stretch/κ + damping, twelve freedoms; exact, but stiff and singular at κ = 0. For refits;
              `sensitivity.stiff` follows stiff ones without their oscillations.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca

from fidim_lab.model.batch import from_rows, rows
from fidim_lab.model.geometry import skew
from fidim_lab.model.mechanism import Mechanism, structure_expression, structure_rate_expression
from fidim_lab.model.motion.contributions import (
    compliances_at,
    extra_count,
    extra_rates_at,
    inertia_at,
    length_drifts_at,
    tension_wrenches_at,
    yieldings_at,
)
from fidim_lab.model.motion.rigid_body import BodyExpressions
from fidim_lab.model.slots import PlatformState

Solver = Callable[[ca.SX, ca.SX], ca.SX]
"""right-hand sides (6) and (n) → [v̇; τ]"""


@dataclass(frozen=True, eq=False)
class Symbols:
    """One sample of a motion, as symbols; `inputs` is their order everywhere."""

    time: ca.SX
    """s since the start of the window"""
    position: ca.SX
    flat: ca.SX
    """rotation row by row (9)"""
    twist: ca.SX
    extra: ca.SX
    body: ca.SX
    """the nine base parameters"""
    theta: ca.SX

    @staticmethod
    def of(mechanism: Mechanism) -> "Symbols":
        """Fresh symbols for a mechanism."""
        sizes = {"time": 1, "position": 3, "flat": 9, "twist": 6, "extra": extra_count(mechanism), "body": 9}
        return Symbols(
            **{name: ca.SX.sym(name, size) for name, size in sizes.items()},
            theta=ca.SX.sym("theta", mechanism.theta.size),
        )

    @property
    def inputs(self) -> list[ca.SX]:
        """time, position, rotation row by row, twist, extra, body, θ."""
        return [self.time, self.position, self.flat, self.twist, self.extra, self.body, self.theta]

    @property
    def rotation(self) -> ca.SX:
        """Body → world (3 × 3)."""
        return from_rows(self.flat, 3, 3)


@dataclass(frozen=True, eq=False)
class MotionEquations:
    """mass v̇ + Ξᵀ τ = wrench and Ξ v̇ = pull, per unit mass; see the module for compliant cables."""

    symbols: Symbols
    state: PlatformState
    body: BodyExpressions
    structure: ca.SX
    """Ξ (n × 6)"""
    lengths: ca.SX
    """geometric lengths as ideal encoders would count them (n), `lengths_at`, m"""
    added_mass: ca.SX
    """A (6 × 6), structurally zero where no effect adds inertia"""
    wrench: ca.SX
    """φ − C v + w − b (6)"""
    by_tension: ca.SX
    """W: wrench (6 × n) for each N/kg of a cable's tension, beside its pull"""
    by_square: ca.SX
    """Y: wrench (6 × n) for the square of a cable's tension, N/kg"""
    drifts: ca.SX
    """how much longer than at time 0 the cables are (n), m"""
    pull: ca.SX
    """l̈ − Ξ̇ v of unstretched cables (n), m/s²"""
    compliance: ca.SX
    """κ (n), m for 1 N/kg; structurally zero where no effect stretches a cable"""
    extra_rates: ca.SX

    @property
    def mass(self) -> ca.SX:
        """M + A (6 × 6)."""
        return self.body.mass_matrix + self.added_mass

    @property
    def pulling(self) -> ca.SX:
        """Ξᵀ − W (6 × n): minus the wrench of each cable for 1 N/kg of its tension."""
        return self.structure.T - self.by_tension

    def factorised(self) -> Solver:
        """Solve the whole system for [v̇; τ]."""
        return saddle(self.mass, self.structure, self.by_tension)

    def solve(self, solver: Solver | None = None) -> ca.SX:
        """[v̇; τ] (6 + n), stretch to first order. `solver` replaces the general factorisation by a better one."""
        solver = solver or self.factorised()
        if self.compliance.is_zero():
            return solver(self.wrench, self.pull)
        held = solver(self.wrench, self.pull)[6:]
        return solver(self.wrench + self.by_square @ held**2, self.pull + self.stretch(solver)[2])

    def wrench_of(self, cables: Sequence[int], tensions: ca.SX) -> ca.SX:
        """Wrench (6) of cables (0-based) that are springs with these tensions, N/kg: their pull, what grows with it."""
        chosen = list(cables)
        return self.by_square[:, chosen] @ tensions**2 - self.pulling[:, chosen] @ tensions

    def length_constraint(self, solver: Solver | None = None) -> tuple[ca.SX, ca.SX]:
        """What the cables hold at any time: drift + stretch (n), m, and its rate (n), m/s.

        `lengths` − this = what ideal encoders read at zero tension, constant; Ξ v = the rate.
        """
        drift_rates = ca.jtimes(self.drifts, self.symbols.time, ca.SX(1))
        if self.compliance.is_zero():
            return self.drifts, drift_rates
        stretch, rate, _ = self.stretch(solver or self.factorised())
        return self.drifts + stretch, drift_rates + rate

    def along(self, expression: ca.SX, accelerations: ca.SX) -> ca.SX:
        """Time derivative of any expression of the sample along a motion with these v̇."""
        s = self.symbols
        turning = rows(skew(s.twist[3:]) @ s.rotation)
        state = ca.vertcat(s.time, s.position, s.flat, s.twist, s.extra)
        rates = ca.vertcat(1, s.twist[:3], turning, accelerations, self.extra_rates)
        return ca.jtimes(expression, state, rates)

    def stretch(self, solver: Solver) -> tuple[ca.SX, ca.SX, ca.SX]:
        """σ = κ τ (n) with the rigid robot's tension, m, and two derivatives of it along the rigid robot's motion."""
        rigid = solver(self.wrench, self.pull)
        accelerations = rigid[:6]
        stretch = self.compliance * rigid[6:]
        rate = self.along(stretch, accelerations)
        return stretch, rate, self.along(rate, accelerations)


def saddle(mass: ca.SX, structure: ca.SX, by_tension: ca.SX) -> Solver:
    """Solve [M Ξᵀ − W; Ξ 0] [v̇; τ] = [f; c] without pivoting: M is positive definite, Ξ has full rank, W is small."""
    if by_tension.is_zero():
        n = structure.size1()
        system = ca.vertcat(ca.horzcat(mass, structure.T), ca.horzcat(structure, ca.SX(n, n)))
        diagonal, lower, order = ca.ldl(system, False)
        return lambda wrench, pull: ca.ldl_solve(ca.vertcat(wrench, pull), diagonal, lower, order)
    factors = ca.ldl(mass, False)
    spread = ca.ldl_solve(structure.T - by_tension, *factors)

    def solve(wrench: ca.SX, pull: ca.SX) -> ca.SX:
        free = ca.ldl_solve(wrench, *factors)
        tensions = ca.solve(structure @ spread, structure @ free - pull)
        return ca.vertcat(free - spread @ tensions, tensions)

    return solve


def motion_equations(mechanism: Mechanism, symbols: Symbols) -> MotionEquations:
    """The equations of a mechanism with all its effects at one sample."""
    rotation, theta = symbols.rotation, symbols.theta
    cables = mechanism.cables_at(symbols.position, rotation, theta)
    body = BodyExpressions.of(symbols.body, rotation)
    state = PlatformState(
        time=symbols.time,
        position=symbols.position,
        rotation=rotation,
        twist=symbols.twist,
        cables=cables,
        com=body.com,
        extra=symbols.extra,
    )
    structure = structure_expression(cables)
    bending = structure_rate_expression(structure, symbols.position, rotation, symbols.twist) @ symbols.twist
    added, bias = inertia_at(mechanism, state, theta)
    wrench = body.gravity_wrench(mechanism.robot.gravity) - body.gyroscopic(symbols.twist[3:]) - bias
    drifts = length_drifts_at(mechanism, symbols.time, theta)
    drift_rates = ca.jtimes(drifts, symbols.time, ca.SX(1))
    return MotionEquations(
        symbols=symbols,
        state=state,
        body=body,
        structure=structure,
        lengths=mechanism.lengths_at(cables, theta),
        added_mass=added,
        wrench=wrench + mechanism.wrench_at(state, theta),
        by_tension=tension_wrenches_at(mechanism, state, theta),
        by_square=yieldings_at(mechanism, state, theta),
        drifts=drifts,
        pull=ca.jtimes(drift_rates, symbols.time, ca.SX(1)) - bending,
        compliance=compliances_at(mechanism, cables, theta),
        extra_rates=extra_rates_at(mechanism, state, theta),
    )
