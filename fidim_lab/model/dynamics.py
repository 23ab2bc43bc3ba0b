"""Free motion in time: accelerations and tensions from Eq. 8 with locked lengths, and its simulation.

    [M Ξᵀ; Ξ 0] [v̇; τ] = [φ − C v; −Ξ̇ v]          per unit mass, τ in N/kg

No free coordinates and no projection: the lengths enter through the initial state alone, and Dormand–Prince's fifth
order at 5 ms lets them drift by about 1e-7 m in 10 s. The rotation is integrated as a Gibbs vector relative to the
rotation at the start of each step, so it never comes near its singularity. `simulate_free_motion` is one compiled call
for a whole window; `motion_step` is its differentiable step, for sensitivities.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from jaxtyping import Float

from fidim_lab.arrays import CableSeries, Series
from fidim_lab.data.records import Body, Motion, Pose
from fidim_lab.errors import InfeasibleError, SetupError
from fidim_lab.model.batch import evaluate, from_rows, function, over_samples, rows
from fidim_lab.model.geometry import gibbs_rate, rotation_from_gibbs
from fidim_lab.model.mechanism import Mechanism, structure_expression, structure_rate_expression
from fidim_lab.model.native import built
from fidim_lab.model.rigid_body import BodyExpressions
from fidim_lab.model.slots import PlatformState

STEP = 5e-3
"""s; 10 ms already invents effects in the score test (FINDINGS.md)"""

STRETCHING = 1e-6
"""m/s of cable that an initial twist may ask for: 1e-5 m in 10 s"""

CHUNK = 200
"""steps: simulations are padded to a multiple, so that few lengths of the compiled loop are ever made"""

# Dormand & Prince (1980), RK5(4)7M; its seventh stage serves the error estimate only.
NODES = (0.0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0)
STAGES = (
    (),
    (1 / 5,),
    (3 / 40, 9 / 40),
    (44 / 45, -56 / 15, 32 / 9),
    (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
    (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
)
WEIGHTS = (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84)


@dataclass(frozen=True, eq=False)
class FreeMotion:
    """A simulated free motion; where a cable goes slack it ends, and the later samples are not there."""

    motion: Motion
    """at the requested times, as far as all cables are taut"""
    tensions: CableSeries
    """per unit mass, N/kg, at the same times"""
    slack_time: float | None
    """s: when the first tension reaches zero, on the times' clock; None where the motion is valid to its end"""
    slack_cable: int | None
    """1-based number of the cable that goes slack then"""


def accelerations(mechanism: Mechanism, body: Body, motion: Motion) -> tuple[Float[np.ndarray, "N 6"], CableSeries]:
    """[p̈; α] and tensions per unit mass (N/kg) at the poses and twists of a motion, its own accelerations unused.

    Raises InfeasibleError at a singular pose.
    """
    mechanism.lengths(motion.positions, motion.rotations)
    right_hand_side = mechanism.compiled("accelerations", _compile_accelerations)
    found = over_samples(
        right_hand_side,
        len(motion.t),
        motion.t[:, np.newaxis],
        motion.positions,
        motion.rotations,
        motion.twists,
        body.vector,
        mechanism.theta,
    )[0]
    return found[:, :6], found[:, 6:]


def simulate_free_motion(
    mechanism: Mechanism, body: Body, pose: Pose, twist: np.ndarray, times: Series, step: float = STEP
) -> FreeMotion:
    """The motion with locked motors from a pose and twist at times[0], sampled at `times` (s, increasing).

    twist: [ṗ; ω], m/s and rad/s, world frame; it must leave the lengths as they are (Ξ v = 0). `step` (s) is the
    largest integration step; each interval between times is divided evenly. Dissipation-free unless an effect adds it.
    Raises InfeasibleError for a twist that stretches a cable, a cable slack at the start, and a singular pose;
    SetupError for times that do not increase. A cable that goes slack later ends the motion: see `FreeMotion`.
    """
    _refuse_stretching(mechanism, pose, twist)
    pieces, samples = _division(times, step)
    states, outputs = _integrate(mechanism, body, pose, twist, float(times[0]), pieces)
    held = outputs[:, 6:]
    end, slack_time, slack_cable = _first_slack(held, times[0] + np.concatenate([[0.0], np.cumsum(pieces)]))
    kept = samples[samples < end]
    _refuse_broken(states[: end + 1], times[0], pieces)
    motion = Motion(
        t=times[: len(kept)],
        positions=states[kept, :3],
        rotations=states[kept, 3:12].reshape(-1, 3, 3),
        twists=states[kept, 12:],
        accelerations=outputs[kept, :6],
    )
    return FreeMotion(motion=motion, tensions=held[kept], slack_time=slack_time, slack_cable=slack_cable)


def motion_step(mechanism: Mechanism) -> ca.Function:
    """One Dormand–Prince step: (state 18, [t, h], χ′ 9, θ) → (state at t + h, [v̇; τ] at t).

    The state is [p; R row by row; v; ω]. Made once for each mechanism; without derivatives for a native one.
    """
    return mechanism.compiled(
        "motion step", lambda made: built(_compile_step(made)) if made.native else _compile_step(made)
    )


def _integrate(
    mechanism: Mechanism, body: Body, pose: Pose, twist: np.ndarray, begin: float, pieces: Float[np.ndarray, " pieces"]
) -> tuple[Float[np.ndarray, "K 18"], Float[np.ndarray, "K k"]]:
    """States and [v̇; τ] at the begin of every piece and at the end of the last."""
    count = len(pieces) + 1
    padded = -(-count // CHUNK) * CHUNK
    steps = np.zeros((padded, 2))
    steps[: len(pieces), 1] = pieces
    steps[:, 0] = begin + np.concatenate([[0.0], np.cumsum(steps[:-1, 1])])
    loop = mechanism.compiled(
        f"motion of {padded} steps", lambda made: motion_step(made).mapaccum("motion", padded, {"base": 8})
    )
    first = np.concatenate([pose.position, pose.rotation.ravel(), twist])
    constants = (np.tile(values, (padded, 1)) for values in (body.vector, mechanism.theta))
    after, outputs = evaluate(loop, first, steps, *constants)
    return np.vstack([first, after[: count - 1]]), outputs[:count]


def _division(times: Series, step: float) -> tuple[Float[np.ndarray, " pieces"], np.ndarray]:
    """Step sizes from times[0] to times[-1], and the index of each time among their ends."""
    intervals = np.diff(times)
    if len(times) == 0 or not np.all(np.isfinite(times)) or np.any(intervals <= 0) or step <= 0:
        raise SetupError("Simulation: times must be finite and increase, and the step be positive.")
    parts = np.maximum(1, np.ceil(intervals / step - 1e-9)).astype(int)
    return np.repeat(intervals / parts, parts), np.concatenate([[0], np.cumsum(parts)])


def _first_slack(held: CableSeries, at: Series) -> tuple[int, float | None, int | None]:
    """How many steps are valid, and when (by interpolation) and which cable goes slack."""
    slack = held <= 0
    if not slack.any():
        return len(held), None, None
    first = int(np.argmax(slack.any(axis=1)))
    cable = int(np.argmin(held[first]))
    if first == 0:
        raise InfeasibleError(
            f"Cable {cable + 1} is slack at the start of the free motion ({held[0, cable]:.2f} N/kg).",
            hint="Displace the platform less, or from another equilibrium.",
        )
    before, after = held[first - 1, cable], held[first, cable]
    share = before / (before - after)
    return first, float(at[first - 1] + share * (at[first] - at[first - 1])), cable + 1


def _refuse_stretching(mechanism: Mechanism, pose: Pose, twist: np.ndarray) -> None:
    xi = mechanism.structure_matrix(pose.position[np.newaxis], pose.rotation[np.newaxis])[0]
    speeds = xi @ twist
    cable = int(np.argmax(np.abs(speeds)))
    if not abs(speeds[cable]) <= STRETCHING:
        raise InfeasibleError(
            f"The initial twist would stretch cable {cable + 1} by {speeds[cable]:.1e} m/s; motors are locked.",
            hint="Build it from free rates: v = Ξ⊥ ẏ_f (free_twist_basis).",
        )


def _refuse_broken(states: np.ndarray, begin: float, pieces: Float[np.ndarray, " pieces"]) -> None:
    broken = ~np.isfinite(states).all(axis=1)
    if broken.any():
        first = int(np.argmax(broken))
        raise InfeasibleError(
            f"The simulated motion reaches a singular pose, or its body is not a body, at t = "
            f"{begin + pieces[:first].sum():.3f} s.",
            hint="Check that the inertia is positive definite and that no attachment comes near its pulley.",
        )


def _compile_accelerations(mechanism: Mechanism) -> ca.Function:
    """(t, p, R row by row, twist, χ′ 9, θ) → [v̇; τ]."""
    time, position, flat = ca.SX.sym("time"), ca.SX.sym("position", 3), ca.SX.sym("rotation", 9)
    twist, parameters = ca.SX.sym("twist", 6), ca.SX.sym("parameters", 9)
    theta = ca.SX.sym("theta", mechanism.theta.size)
    rotation = from_rows(flat, 3, 3)
    cables = mechanism.cables_at(position, rotation, theta)
    body = BodyExpressions.of(parameters, rotation)
    xi = structure_expression(cables)
    xi_rate = structure_rate_expression(xi, position, rotation, twist)
    state = PlatformState(time=time, position=position, rotation=rotation, twist=twist, cables=cables)
    force = body.gravity_wrench(mechanism.robot.gravity) - body.gyroscopic(twist[3:])
    force += mechanism.wrench_at(state, theta)
    system = ca.vertcat(ca.horzcat(body.mass_matrix, xi.T), ca.horzcat(xi, ca.SX(mechanism.n, mechanism.n)))
    # M is positive definite and Ξ has full rank, so L D Lᵀ without pivoting exists: half the work of a QR
    diagonal, lower, order = ca.ldl(system, False)
    solution = ca.ldl_solve(ca.vertcat(force, -xi_rate @ twist), diagonal, lower, order)
    return function("accelerations", [time, position, flat, twist, parameters, theta], [solution])


def _compile_step(mechanism: Mechanism) -> ca.Function:
    solve = mechanism.compiled("accelerations", _compile_accelerations)
    state, timing = ca.SX.sym("state", 18), ca.SX.sym("timing", 2)
    parameters, theta = ca.SX.sym("parameters", 9), ca.SX.sym("theta", mechanism.theta.size)
    time, h = timing[0], timing[1]
    reference = from_rows(state[3:12], 3, 3)
    start = ca.vertcat(state[:3], ca.SX.zeros(3), state[12:])  # [p; g; v; ω]
    slopes: list[ca.SX] = []
    outputs: list[ca.SX] = []
    for node, coefficients in zip(NODES, STAGES, strict=True):
        at = start + h * sum((c * slope for c, slope in zip(coefficients, slopes, strict=True)), ca.SX.zeros(12))
        rotation = rotation_from_gibbs(at[3:6]) @ reference
        output = solve(time + node * h, at[:3], rows(rotation), at[6:], parameters, theta)
        outputs.append(output)
        slopes.append(ca.vertcat(at[6:9], gibbs_rate(at[3:6], at[9:]), output[:6]))
    end = start + h * sum((w * slope for w, slope in zip(WEIGHTS, slopes, strict=True)), ca.SX.zeros(12))
    after = ca.vertcat(end[:3], rows(rotation_from_gibbs(end[3:6]) @ reference), end[6:])
    return function("motion_step", [state, timing, parameters, theta], [after, outputs[0]])
