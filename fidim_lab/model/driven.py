"""Motion while the winches move: Eq. 8 and 10 with known l̇ and l̈ instead of locked lengths.

    [M Ξᵀ; Ξ 0] [v̇; τ] = [φ − C v; l̈ − Ξ̇ v]          per unit mass, τ in N/kg

For planning short moves of the winches (fourth order at fixed steps); `dynamics` has free motion. Slack cables show as
negative tensions: they are to be checked.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from jaxtyping import Float

from fidim_lab.data.records import Body, Pose
from fidim_lab.model.batch import evaluate, from_rows, function, rows
from fidim_lab.model.equations import Symbols, motion_equations
from fidim_lab.model.geometry import gibbs_rate, rotation_from_gibbs
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.native import built

STEP = 5e-3
"""s"""


@dataclass(frozen=True, eq=False)
class Driven:
    """M motions from one rest, at N + 1 times STEP apart."""

    positions: Float[np.ndarray, "M N+1 3"]
    rotations: Float[np.ndarray, "M N+1 3 3"]
    twists: Float[np.ndarray, "M N+1 6"]
    """[ṗ; ω], world frame"""
    tensions: Float[np.ndarray, "M N n"]
    """per unit mass, N/kg, at the begin of each step"""


def driven_motions(
    mechanism: Mechanism, body: Body, start: Pose, accelerations: Float[np.ndarray, "M N n"], step: float = STEP
) -> Driven:
    """Motions from rest at `start` while the cables' lengths have these second derivatives (m/s²) in each step (s).

    NaN from where a motion breaks down.
    """
    count, steps, n = accelerations.shape
    loop = mechanism.compiled(
        f"driven: {count} motions, {steps} steps",
        lambda made: _step(made).mapaccum("driven", steps, {"base": 8}).map(count),
    )
    first = np.concatenate([start.position, start.rotation.ravel(), np.zeros(6)])
    given = np.concatenate([accelerations, np.full((count, steps, 1), step)], axis=2)
    body_rows = np.broadcast_to(body.vector, (count * steps, 9))
    states, tensions = evaluate(loop, np.broadcast_to(first, (count, 18)), given, body_rows)
    after = states.reshape(count, steps, 18)
    at = np.concatenate([np.broadcast_to(first, (count, 1, 18)), after], axis=1)
    return Driven(
        positions=at[..., :3],
        rotations=at[..., 3:12].reshape(count, steps + 1, 3, 3),
        twists=at[..., 12:],
        tensions=tensions.reshape(count, steps, n),
    )


def _step(mechanism: Mechanism) -> ca.Function:
    def make(made: Mechanism) -> ca.Function:
        compiled = _compile(made)
        return built(compiled) if made.native else compiled

    return mechanism.compiled("driven: step", make)


def _compile(mechanism: Mechanism) -> ca.Function:
    """(state 18, [l̈; h], body) → (state after h, τ before): Runge and Kutta's fourth order, R = R(g) R_before."""
    symbols = Symbols.of(mechanism)
    equations = motion_equations(mechanism, symbols)
    pulled = ca.SX.sym("pulled", mechanism.n)
    found = equations.factorised()(equations.wrench, equations.pull + pulled)
    given = [symbols.position, symbols.flat, symbols.twist, symbols.body, pulled]
    fixed = [symbols.time, symbols.extra, symbols.theta]
    absent = [ca.SX(0), ca.SX.zeros(symbols.extra.numel()), ca.SX(ca.DM(mechanism.theta))]
    solve = ca.Function("solve", given, ca.substitute([found], fixed, absent))
    state, timing, body = ca.SX.sym("state", 18), ca.SX.sym("timing", mechanism.n + 1), ca.SX.sym("body", 9)
    pull, h = timing[: mechanism.n], timing[mechanism.n]
    before = from_rows(state[3:12], 3, 3)

    def rate(at: ca.SX) -> tuple[ca.SX, ca.SX]:
        answer = solve(at[:3], rows(rotation_from_gibbs(at[3:6]) @ before), at[6:], body, pull)
        return ca.vertcat(at[6:9], gibbs_rate(at[3:6], at[9:]), answer[:6]), answer[6:]

    start = ca.vertcat(state[:3], ca.SX.zeros(3), state[12:])
    k1, tensions = rate(start)
    k2, _ = rate(start + h / 2 * k1)
    k3, _ = rate(start + h / 2 * k2)
    k4, _ = rate(start + h * k3)
    end = start + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    after = ca.vertcat(end[:3], rows(rotation_from_gibbs(end[3:6]) @ before), end[6:])
    return function("driven_step", [state, timing, body], [after, tensions])
