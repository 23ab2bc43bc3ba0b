"""Free motion in time: accelerations and tensions from Eq. 8 with locked lengths, and its simulation.

    [M Ξᵀ; Ξ 0] [v̇; τ] = [φ − C v; −Ξ̇ v]          per unit mass, τ in N/kg; `equations` has it with effects

No free coordinates and no projection: the lengths enter through the initial state alone, and Dormand–Prince's fifth
order at 5 ms lets them drift by about 1e-7 m in 10 s. The rotation is integrated as a Gibbs vector relative to the
rotation at the start of each step, so it never comes near its singularity. `simulate_free_motion` is one compiled call
for a whole window; `motion_step` is its differentiable step, for sensitivities. Compliant cables stretch
as the rigid ones' tension asks (first order); `elastic` has them as springs.
"""

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np
from jaxtyping import Float

from fidim_lab.arrays import CableSeries, Series
from fidim_lab.data.records import Body, Motion, Pose
from fidim_lab.errors import InfeasibleError, SetupError
from fidim_lab.model.batch import evaluate, from_rows, function, over_samples, rows
from fidim_lab.model.geometry import gibbs_rate, rotation_from_gibbs
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion.contributions import extra_count, extra_start_at
from fidim_lab.model.motion.equations import Symbols, motion_equations
from fidim_lab.model.native import built
from fidim_lab.model.slots import PlatformState

STEP = 5e-3
"""s; 10 ms already invents effects in the score test (spec/findings.md)"""

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
    extra_states: Float[np.ndarray, "N extra"]
    """of the effects that have some, at the same times"""


def accelerations(
    mechanism: Mechanism, body: Body, motion: Motion, extra: Float[np.ndarray, "N extra"] | None = None
) -> tuple[Float[np.ndarray, "N 6"], CableSeries]:
    """[p̈; α] and tensions per unit mass (N/kg) at the poses and twists of a motion, its own accelerations unused.

    extra: the extra states where effects have some. Raises InfeasibleError at a singular pose.
    """
    mechanism.lengths(motion.positions, motion.rotations)
    found = over_samples(
        _right_hand_side(mechanism),
        len(motion.t),
        motion.t[:, np.newaxis],
        motion.positions,
        motion.rotations,
        motion.twists,
        np.zeros((len(motion.t), 0)) if extra is None else extra,
        body.vector,
        mechanism.theta,
    )[0]
    return found[:, :6], found[:, 6:]


def simulate_free_motion(
    mechanism: Mechanism,
    body: Body,
    pose: Pose,
    twist: np.ndarray,
    times: Series,
    step: float = STEP,
    *,
    extra: np.ndarray | None = None,
) -> FreeMotion:
    """The motion with locked motors from a pose and twist at times[0], sampled at `times` (s, increasing).

    twist: [ṗ; ω], m/s and rad/s, world frame; it must leave the lengths as they are (Ξ v = 0, or the rate at which
    effects let the cables grow: `consistent_twist`). `step` (s) is the largest integration step; each interval between
    times is divided evenly. extra: the effects' own states at times[0], by default as they say. Dissipation-free
    unless an effect adds it.
    Raises InfeasibleError for a twist that stretches a cable, a cable slack at the start, and a singular pose;
    SetupError for times that do not increase. A cable that goes slack later ends the motion: see `FreeMotion`.
    """
    if extra is None:
        extra = default_extra(mechanism, pose, twist)
    _refuse_stretching(mechanism, body, pose, twist, float(times[0]), extra)
    first = np.concatenate([pose.position, pose.rotation.ravel(), twist, extra])
    return simulated(mechanism, "motion", motion_step, first, times, step, (body.vector, mechanism.theta))


def simulated(
    mechanism: Mechanism,
    name: str,
    make_step: Callable[[Mechanism], ca.Function],
    first: np.ndarray,
    times: Series,
    step: float,
    constants: tuple[np.ndarray, ...],
) -> FreeMotion:
    """The motion from a first state [p; R row by row; v; ω; extra] with a compiled step; see `simulate_free_motion`."""
    pieces, samples = _division(times, step)
    states, outputs = _integrate(mechanism, name, make_step, first, float(times[0]), pieces, constants)
    held = outputs[:, 6:]
    end, slack_time, slack_cable = _first_slack(held, times[0] + np.concatenate([[0.0], np.cumsum(pieces)]))
    kept = samples[samples < end]
    _refuse_broken(states[: end + 1], times[0], pieces)
    motion = Motion(
        t=times[: len(kept)],
        positions=states[kept, :3],
        rotations=states[kept, 3:12].reshape(-1, 3, 3),
        twists=states[kept, 12:18],
        accelerations=outputs[kept, :6],
    )
    return FreeMotion(motion, held[kept], slack_time, slack_cable, extra_states=states[kept, 18:])


def motion_step(mechanism: Mechanism) -> ca.Function:
    """One Dormand–Prince step: (state 18 + extra, [t, h], χ′ 9, θ) → (state at t + h, [v̇; τ] at t).

    The state is [p; R row by row; v; ω; extra]. Made once for each mechanism; without derivatives for a native one.
    """
    return mechanism.compiled(
        "motion step", lambda made: native_or_not(made, stepping("motion_step", _right_hand_side(made)))
    )


def native_or_not(mechanism: Mechanism, compiled: ca.Function) -> ca.Function:
    """Machine code where the mechanism asks for it."""
    return built(compiled) if mechanism.native else compiled


def default_extra(mechanism: Mechanism, pose: Pose, twist: np.ndarray) -> np.ndarray:
    """The effects' extra states at the start of a window in this pose and twist, as the effects say."""
    compiled = mechanism.compiled("extra start", _compile_extra_start)
    return evaluate(compiled, pose.position, pose.rotation, twist, mechanism.robot.nominal.com, mechanism.theta)[0][0]


def consistent_twist(
    mechanism: Mechanism, body: Body, pose: Pose, twist: np.ndarray, time: float = 0.0, extra: np.ndarray | None = None
) -> np.ndarray:
    """The twist nearest to `twist`, in kinetic energy, at which the cables lengthen as the effects let them.

    That is Ξ v = 0 for rigid cables. Units as `simulate_free_motion`. Raises InfeasibleError at a singular pose.
    """
    if extra is None:
        extra = default_extra(mechanism, pose, twist)
    for _ in range(3):  # the rate of stretch depends, weakly, on the twist
        xi, rates, mass = _constrained(mechanism, body, pose, twist, time, extra)
        spread = np.linalg.solve(mass, xi.T)
        twist = twist - spread @ np.linalg.solve(xi @ spread, xi @ twist - rates)
    return twist


def _integrate(
    mechanism: Mechanism,
    name: str,
    make_step: Callable[[Mechanism], ca.Function],
    first: np.ndarray,
    begin: float,
    pieces: Float[np.ndarray, " pieces"],
    constants: tuple[np.ndarray, ...],
) -> tuple[Float[np.ndarray, "K states"], Float[np.ndarray, "K k"]]:
    """States and [v̇; τ] at the begin of every piece and at the end of the last."""
    count = len(pieces) + 1
    padded = -(-count // CHUNK) * CHUNK
    steps = np.zeros((padded, 2))
    steps[: len(pieces), 1] = pieces
    steps[:, 0] = begin + np.concatenate([[0.0], np.cumsum(steps[:-1, 1])])
    loop = mechanism.compiled(
        f"{name} of {padded} steps", lambda made: make_step(made).mapaccum("motion", padded, {"base": 8})
    )
    after, outputs = evaluate(loop, first, steps, *(np.tile(values, (padded, 1)) for values in constants))
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


def _refuse_stretching(
    mechanism: Mechanism, body: Body, pose: Pose, twist: np.ndarray, time: float, extra: np.ndarray
) -> None:
    xi, rates, _ = _constrained(mechanism, body, pose, twist, time, extra)
    speeds = xi @ twist - rates
    cable = int(np.argmax(np.abs(speeds)))
    if not abs(speeds[cable]) <= STRETCHING:
        raise InfeasibleError(
            f"The initial twist would stretch cable {cable + 1} by {speeds[cable]:.1e} m/s; motors are locked.",
            hint="Build it from free rates: v = Ξ⊥ ẏ_f (free_twist_basis), or project it: consistent_twist.",
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


def _constrained(
    mechanism: Mechanism, body: Body, pose: Pose, twist: np.ndarray, time: float, extra: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Ξ (n, 6), the rates (n) at which the cables lengthen by themselves, and M + A (6, 6)."""
    xi = mechanism.structure_matrix(pose.position[np.newaxis], pose.rotation[np.newaxis])[0]
    compiled = mechanism.compiled("constraint", _compile_constraint)
    given = (np.array([time]), pose.position, pose.rotation, twist, extra, body.vector, mechanism.theta)
    rates, mass = evaluate(compiled, *given)
    return xi, rates[0], mass.reshape(6, 6)


def _right_hand_side(mechanism: Mechanism) -> ca.Function:
    """(t, p, R row by row, twist, extra, χ′ 9, θ) → ([v̇; τ], rates of the extra states)."""
    return mechanism.compiled("accelerations", _compile_accelerations)


def _compile_accelerations(mechanism: Mechanism) -> ca.Function:
    equations = motion_equations(mechanism, Symbols.of(mechanism))
    return function("accelerations", equations.symbols.inputs, [equations.solve(), equations.extra_rates])


def _compile_constraint(mechanism: Mechanism) -> ca.Function:
    equations = motion_equations(mechanism, Symbols.of(mechanism))
    return function("constraint", equations.symbols.inputs, [equations.length_constraint()[1], rows(equations.mass)])


def _compile_extra_start(mechanism: Mechanism) -> ca.Function:
    symbols = Symbols.of(mechanism)
    com = ca.SX.sym("com", 3)
    state = PlatformState(
        time=ca.SX(0),
        position=symbols.position,
        rotation=symbols.rotation,
        twist=symbols.twist,
        cables=mechanism.cables_at(symbols.position, symbols.rotation, symbols.theta),
        com=symbols.rotation @ com,
        extra=ca.SX.zeros(extra_count(mechanism)),
    )
    inputs = [symbols.position, symbols.flat, symbols.twist, com, symbols.theta]
    return function("extra_start", inputs, [extra_start_at(mechanism, state, symbols.theta)])


def stepping(name: str, right_hand_side: ca.Function) -> ca.Function:
    """One Dormand–Prince step with (t, p, R row by row, twist, extra, constants…) → ([v̇; τ], extra rates)."""
    extra = right_hand_side.numel_in(4)
    state, timing = ca.SX.sym("state", 18 + extra), ca.SX.sym("timing", 2)
    constants = [ca.SX.sym(f"constant_{i}", right_hand_side.numel_in(i)) for i in range(5, right_hand_side.n_in())]
    time, h = timing[0], timing[1]
    reference = from_rows(state[3:12], 3, 3)
    start = ca.vertcat(state[:3], ca.SX.zeros(3), state[12:])  # [p; g; v; ω; extra]
    slopes: list[ca.SX] = []
    outputs: list[ca.SX] = []
    for node, coefficients in zip(NODES, STAGES, strict=True):
        moved = (c * slope for c, slope in zip(coefficients, slopes, strict=True))
        at = start + h * sum(moved, ca.SX.zeros(12 + extra))
        rotation = rotation_from_gibbs(at[3:6]) @ reference
        output, rates = right_hand_side(time + node * h, at[:3], rows(rotation), at[6:12], at[12:], *constants)
        outputs.append(output)
        slopes.append(ca.vertcat(at[6:9], gibbs_rate(at[3:6], at[9:12]), output[:6], rates))
    total = sum((w * slope for w, slope in zip(WEIGHTS, slopes, strict=True)), ca.SX.zeros(12 + extra))
    end = start + h * total
    after = ca.vertcat(end[:3], rows(rotation_from_gibbs(end[3:6]) @ reference), end[6:])
    return function(name, [state, timing, *constants], [after, outputs[0]])
