"""Motion while the winches move: Eq. 8 and 10 with known l̇ and l̈ instead of locked lengths.

    [M Ξᵀ; Ξ 0] [v̇; τ] = [φ − C v − D v; l̈ − Ξ̇ v]          per unit mass, τ in N/kg

For planning short moves of the winches (fourth order at fixed steps); `dynamics` has free motion. `driven_motions` for
many motions at once, `driven_derivative` for one with exact derivatives by whatever the accelerations depend on. D is a
constant damping, what dissipation near an equilibrium comes to. Slack cables show as negative tensions: they are to be
checked.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
from jaxtyping import Float

from fidim_lab.data.records import Body, Pose
from fidim_lab.model.batch import evaluate, from_rows, function, rows
from fidim_lab.model.geometry import gibbs_rate, rotation_from_gibbs
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion.equations import Symbols, motion_equations
from fidim_lab.model.native import built

STEP = 5e-3
"""s"""
STATE = 18
"""position, rotation row by row, twist"""

Steps = float | Float[np.ndarray, " N"]


@dataclass(frozen=True, eq=False)
class Driven:
    """M motions, each from its own start, at the N + 1 ends of N steps."""

    positions: Float[np.ndarray, "M N+1 3"]
    rotations: Float[np.ndarray, "M N+1 3 3"]
    twists: Float[np.ndarray, "M N+1 6"]
    """[ṗ; ω], world frame"""
    tensions: Float[np.ndarray, "M N n"]
    """per unit mass, N/kg, at the begin of each step"""


@dataclass(frozen=True, eq=False)
class DrivenEnd:
    """Where one motion ends, with derivatives by P parameters of the accelerations."""

    pose: Pose
    twist: Float[np.ndarray, "6"]
    pose_by: Float[np.ndarray, "6 P"]
    """[δp; δθ], δθ the rotation about the world's axes, R → R(δθ/2) R"""
    twist_by: Float[np.ndarray, "6 P"]


def driven_motions(
    mechanism: Mechanism,
    body: Body | Sequence[Body],
    start: Pose | Sequence[Pose],
    accelerations: Float[np.ndarray, "M N n"],
    step: Steps = STEP,
    damping: Float[np.ndarray, "6 6"] | None = None,
    twist: Float[np.ndarray, "6"] | None = None,
) -> Driven:
    """Motions from rest at `start` while the cables' lengths have these second derivatives (m/s²) in each step (s).

    body, start: one for all, or one for each motion. damping: D per unit mass, world frame, over [ṗ; ω]. twist: with
    which all of them begin, where not from rest. NaN from where a motion breaks down.
    """
    count, steps, n = accelerations.shape
    loop = mechanism.compiled(
        f"driven: {count} motions, {steps} steps",
        lambda made: _step(made).mapaccum("driven", steps, {"base": 8}).map(count),
    )
    starts = [start] * count if isinstance(start, Pose) else list(start)
    bodies = [body] * count if isinstance(body, Body) else list(body)
    first = np.array([_state(pose, twist) for pose in starts])
    given = _given(accelerations, step, damping)
    body_rows = np.repeat([one.vector for one in bodies], steps, axis=0)
    states, tensions = evaluate(loop, first, given, body_rows)
    at = np.concatenate([first[:, np.newaxis], states.reshape(count, steps, STATE)], axis=1)
    return Driven(
        positions=at[..., :3],
        rotations=at[..., 3:12].reshape(count, steps + 1, 3, 3),
        twists=at[..., 12:],
        tensions=tensions.reshape(count, steps, n),
    )


def driven_derivative(
    mechanism: Mechanism,
    body: Body,
    start: Pose,
    accelerations: Float[np.ndarray, "N n"],
    by: Float[np.ndarray, "N n P"],
    step: Steps = STEP,
    damping: Float[np.ndarray, "6 6"] | None = None,
) -> DrivenEnd:
    """Where the motion of `driven_motions` ends, with its derivative; `by` is that of the accelerations.

    Exact for the steps as they are taken: tangents go through the same arithmetic.
    """
    steps, _, parameters = by.shape
    loop = mechanism.compiled(
        f"driven: derivative by {parameters}, {steps} steps",
        lambda made: _tangent_step(made, parameters).mapaccum("driven_tangent", steps, {"base": 8}),
    )
    given = _given(accelerations[np.newaxis], step, damping)
    first = np.concatenate([_state(start), np.zeros(STATE * parameters)])
    # CasADi's columns: (N, n, P) → for each step P columns of n
    tangents = np.ascontiguousarray(np.swapaxes(by, 1, 2)).reshape(steps, -1)
    body_rows = np.broadcast_to(body.vector, (steps, 9))
    states = evaluate(loop, first, given, tangents, body_rows)[0][-1]
    end, slopes = states[:STATE], states[STATE:].reshape(parameters, STATE).T
    rotation = end[3:12].reshape(3, 3)
    turned = slopes[3:12].reshape(3, 3, parameters)
    spin = np.einsum("ijp,kj->ikp", turned, rotation)  # dR Rᵀ = [δθ]×
    turning = np.stack([spin[2, 1] - spin[1, 2], spin[0, 2] - spin[2, 0], spin[1, 0] - spin[0, 1]]) / 2
    return DrivenEnd(
        pose=Pose(position=end[:3], rotation=rotation),
        twist=end[12:],
        pose_by=np.concatenate([slopes[:3], turning]),
        twist_by=slopes[12:],
    )


def _state(pose: Pose, twist: Float[np.ndarray, "6"] | None = None) -> Float[np.ndarray, "18"]:
    return np.concatenate([pose.position, pose.rotation.ravel(), np.zeros(6) if twist is None else twist])


def _given(
    accelerations: Float[np.ndarray, "M N n"], step: Steps, damping: Float[np.ndarray, "6 6"] | None
) -> Float[np.ndarray, "M N n+37"]:
    """[l̈; h; D row by row] of each step."""
    count, steps, _ = accelerations.shape
    durations = np.broadcast_to(np.broadcast_to(step, (steps,))[:, np.newaxis], (count, steps, 1))
    matrix = np.zeros((6, 6)) if damping is None else damping
    return np.concatenate([accelerations, durations, np.broadcast_to(matrix.ravel(), (count, steps, 36))], axis=2)


def _step(mechanism: Mechanism) -> ca.Function:
    def make(made: Mechanism) -> ca.Function:
        state, given, body, after, tensions = _stepped(made)
        compiled = function("driven_step", [state, given, body], [after, tensions])
        return built(compiled) if made.native else compiled

    return mechanism.compiled("driven: step", make)


def _tangent_step(mechanism: Mechanism, parameters: int) -> ca.Function:
    """([state; tangents], [l̈; h; D], tangents of l̈, body) → the same after the step."""

    def make(made: Mechanism) -> ca.Function:
        state, given, body, after, _ = _stepped(made)
        own, driven = ca.SX.sym("own", STATE, parameters), ca.SX.sym("driven", made.n, parameters)
        both, slopes = ca.vertcat(state, given[: made.n]), ca.vertcat(own, driven)
        moved = ca.jtimes(after, both, slopes)
        compiled = function(
            f"driven_tangent_{parameters}",
            [ca.vertcat(state, ca.vec(own)), given, ca.vec(driven), body],
            [ca.vertcat(after, ca.vec(moved))],
        )
        return built(compiled) if made.native else compiled

    return mechanism.compiled(f"driven: tangents of {parameters}", make)


def _stepped(mechanism: Mechanism) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX, ca.SX]:
    """State, [l̈; h; D], body, state after h, tensions before: Runge and Kutta's fourth order, R = R(g) R_before."""
    n = mechanism.n
    solve = _accelerations(mechanism)
    state, given, body = ca.SX.sym("state", STATE), ca.SX.sym("given", n + 37), ca.SX.sym("body", 9)
    pull, h, damping = given[:n], given[n], given[n + 1 :]
    before = from_rows(state[3:12], 3, 3)

    def rate(at: ca.SX) -> tuple[ca.SX, ca.SX]:
        answer = solve(at[:3], rows(rotation_from_gibbs(at[3:6]) @ before), at[6:], body, pull, damping)
        return ca.vertcat(at[6:9], gibbs_rate(at[3:6], at[9:]), answer[:6]), answer[6:]

    start = ca.vertcat(state[:3], ca.SX.zeros(3), state[12:])
    k1, tensions = rate(start)
    k2, _ = rate(start + h / 2 * k1)
    k3, _ = rate(start + h / 2 * k2)
    k4, _ = rate(start + h * k3)
    end = start + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    after = ca.vertcat(end[:3], rows(rotation_from_gibbs(end[3:6]) @ before), end[6:])
    return state, given, body, after, tensions


def _accelerations(mechanism: Mechanism) -> ca.Function:
    """(position, rotation, twist, body, l̈, D) → [v̇; τ]."""
    symbols = Symbols.of(mechanism)
    equations = motion_equations(mechanism, symbols)
    pulled, flat = ca.SX.sym("pulled", mechanism.n), ca.SX.sym("damping", 36)
    damped = equations.wrench - from_rows(flat, 6, 6) @ symbols.twist
    found = equations.factorised()(damped, equations.pull + pulled)
    given = [symbols.position, symbols.flat, symbols.twist, symbols.body, pulled, flat]
    fixed = [symbols.time, symbols.extra, symbols.theta]
    absent = [ca.SX(0), ca.SX.zeros(symbols.extra.numel()), ca.SX(ca.DM(mechanism.theta))]
    return ca.Function("solve", given, ca.substitute([found], fixed, absent))
