"""Tensions of cables that are springs, from their stretch (spec/model.md §6).

    stretch = l − l₀ − drift,   τ = stretch/κ + c · d stretch/dt

κ is the effects' compliance, c their damping. Wrong where κ is 0, and stiff where it is small: there the first-order
stretch of rigid cables is right. The lengths l₀ of the unstretched cables are parameters of a window here, while the
rigid model has them in its initial pose alone.
"""

import casadi as ca

from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion.contributions import stretch_dampings
from fidim_lab.model.motion.equations import MotionEquations


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
