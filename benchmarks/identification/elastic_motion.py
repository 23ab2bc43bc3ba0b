"""Free motion on cables that are springs, in small steps: the answer that `model.sensitivity` is held against.

    τ = stretch/κ + c · d stretch/dt,   M v̇ = φ − C v + w − (Ξᵀ − W) τ

Twelve freedoms, tensions by `model.sensitivity.equations`; W is what the effects do for each newton of tension, per
unit mass.
Cables that no effect stretches stay rigid.
"""

import casadi as ca
import numpy as np

from fidim_lab.arrays import PerCable, Series
from fidim_lab.data.records import Body, Pose
from fidim_lab.errors import SetupError
from fidim_lab.model.batch import function
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion.dynamics import FreeMotion, default_extra, native_or_not, simulated, stepping
from fidim_lab.model.motion.equations import MotionEquations, Symbols, motion_equations, saddle
from fidim_lab.model.sensitivity.equations import compliant_cables, spring_tensions

STEP = 1e-3
"""s; enough for 10 kg on cables of 1e6 N/m"""


def simulate_elastic_motion(
    mechanism: Mechanism,
    body: Body,
    pose: Pose,
    twist: np.ndarray,
    times: Series,
    lengths: PerCable,
    step: float = STEP,
    *,
    extra: np.ndarray | None = None,
) -> FreeMotion:
    """The motion from any pose and twist at times[0] on cables of unstretched `lengths` (n), m.

    Tensions and arguments as `dynamics.simulate_free_motion`; a twist may stretch compliant cables. `lengths` as ideal
    encoders read them at zero tension; those of rigid cables do not matter.
    Raises SetupError where a compliance is not positive; otherwise as `simulate_free_motion`.
    """
    if extra is None:
        extra = default_extra(mechanism, pose, twist)
    first = np.concatenate([pose.position, pose.rotation.ravel(), twist, extra])
    _refuse_rigid(mechanism, first, body)
    return simulated(mechanism, "elastic", elastic_step, first, times, step, (body.vector, mechanism.theta, lengths))


def elastic_step(mechanism: Mechanism) -> ca.Function:
    """One Dormand–Prince step: (state 18 + extra, [t, h], χ′ 9, θ, l₀) → (state at t + h, [v̇; τ] at t)."""
    return mechanism.compiled(
        "elastic step",
        lambda made: native_or_not(made, stepping("elastic_step", made.compiled("elastic", _compile_accelerations))),
    )


def springs(mechanism: Mechanism, equations: MotionEquations, lengths: ca.SX) -> ca.SX:
    """[v̇; τ] (6 + n) with compliant cables as springs of unstretched lengths (n, m); the others rigid."""
    compliant = compliant_cables(equations)
    rigid = [k for k in range(mechanism.n) if k not in compliant]
    tension = spring_tensions(mechanism, equations, lengths[compliant])
    wrench = equations.wrench + equations.wrench_of(compliant, tension)
    solver = saddle(equations.mass, equations.structure[rigid, :], equations.by_tension[:, rigid])
    found = solver(wrench, ca.vertcat(ca.SX(0, 1), *(equations.pull[k] for k in rigid)))
    every = ca.SX.zeros(mechanism.n)
    every[compliant] = tension
    for place, k in enumerate(rigid):
        every[k] = found[6 + place]
    return ca.vertcat(found[:6], every)


def _compile_accelerations(mechanism: Mechanism) -> ca.Function:
    lengths = ca.SX.sym("lengths", mechanism.n)
    equations = motion_equations(mechanism, Symbols.of(mechanism))
    outputs = [springs(mechanism, equations, lengths), equations.extra_rates]
    return function("elastic", [*equations.symbols.inputs, lengths], outputs)


def _refuse_rigid(mechanism: Mechanism, first: np.ndarray, body: Body) -> None:
    compiled = mechanism.compiled("compliance", _compile_compliance)
    found = compiled(0, first[:3], first[3:12], first[12:18], first[18:], body.vector, mechanism.theta)
    for number, (structural, value) in enumerate(
        zip(*(np.array(part).ravel() for part in found), strict=True), start=1
    ):
        if structural and not value > 0:
            raise SetupError(
                f"Cable {number} cannot be a spring: its compliance is {value:.3g} m for 1 N/kg.",
                hint="Start from a positive compliance, or use the rigid model with first-order stretch.",
            )


def _compile_compliance(mechanism: Mechanism) -> ca.Function:
    equations = motion_equations(mechanism, Symbols.of(mechanism))
    structural = ca.SX([0.0 if equations.compliance[k].is_zero() else 1.0 for k in range(mechanism.n)])
    return function("compliance", equations.symbols.inputs, [structural, equations.compliance])
