"""The methods `ls` and `iv`: weighted least squares on the regressor, and the same with simulated instruments.

Both weight the equations as `tls` does (in marker accelerations, with the body found so far), give every window the
weight of its own residual, and report the Durbin–Wu–Hausman test. `linear` has the mathematics.

σ_W and C are given in the sense of Eq. 31 and 40, so that all methods on the regressor can be compared: σ_W is the
residual's standard deviation over ‖χ‖.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fidim_lab.data.records import PARAMETER_NAMES, Body, Role
from fidim_lab.errors import RefusedError
from fidim_lab.identification.equations import linear, tls
from fidim_lab.identification.equations.consistency import can_move
from fidim_lab.identification.equations.estimate import Estimate
from fidim_lab.identification.equations.instruments import Instrumented, instrumented
from fidim_lab.identification.equations.linear import LinearFit, Sampled
from fidim_lab.identification.equations.problem import Problem, WindowEquations
from fidim_lab.identification.equations.uncertainty import bootstrap_sd, leave_one_out
from fidim_lab.identification.motion.recipe import BalanceRows
from fidim_lab.model.mechanism import Mechanism

SETTLED = 0.1
"""of each parameter's sd: instruments are not simulated anew for less"""
MOST_ROUNDS = 8
WEAK = 0.7
"""smallest canonical correlation of regressor and instruments below which a warning is due"""


def estimate_ls(problem: Problem) -> Estimate:
    """Weighted least squares over all usable `identify` windows.

    Raises RefusedError when the windows do not identify a body.
    """
    weights, windows = _least_squares(problem)
    found = _estimate(problem, windows, weights)
    return replace(found, notes=(*found.notes, *_hausman_note(problem, Body.from_vector(found.values), weights)))


def estimate_iv(problem: Problem) -> Estimate:
    """Instrumental variables, simulated anew until the parameters settle (within 0.1 sd).

    Raises RefusedError when the windows do not identify a body, or none of them can be simulated.
    """
    weights, start = _least_squares(problem)
    iterated = _iterate(problem, Body.from_vector(linear.fit(start).values), weights)
    windows = linear.evened(iterated.instruments.windows)
    found = _estimate(problem, windows, weights)
    notes = [*found.notes, *_missing_note(iterated.instruments), linear.hausman(windows).sentence()]
    if not iterated.settled:
        notes.append(f"The instruments had not settled after {MOST_ROUNDS} rounds of simulation.")
    if (strength := linear.strength(windows)) < WEAK:
        notes.append(
            f"The simulated motion hardly follows the recorded one (canonical correlation {strength:.2f}): instruments "
            "are weak, and so are their parameters."
        )
    return replace(found, notes=tuple(notes))


@dataclass(frozen=True, eq=False)
class _Iterated:
    instruments: Instrumented
    settled: bool


def _iterate(problem: Problem, body: Body, weights: Body) -> _Iterated:
    windows = problem.of_role(Role.IDENTIFY)
    mechanism = Mechanism(problem.campaign.robot, native=True)
    made = _simulated(problem, mechanism, windows, body, weights)
    before = body.vector
    for _ in range(MOST_ROUNDS):
        found = linear.fit(linear.evened(made.windows))
        body = Body.from_vector(found.values)
        if np.abs((found.values - before) / found.sd).max() < SETTLED:
            return _Iterated(made, settled=True)
        if not can_move(body):
            break
        before = found.values
        made = _simulated(problem, mechanism, windows, body, weights)
    return _Iterated(made, settled=False)


def _simulated(
    problem: Problem, mechanism: Mechanism, windows: tuple[WindowEquations, ...], body: Body, weights: Body
) -> Instrumented:
    made = instrumented(problem, mechanism, windows, body, weights)
    if not made.windows:
        raise RefusedError(
            "No window can be simulated with the body that least squares finds, so there are no instruments.",
            hint="Instruments need cable lengths (l1…ln) and taut cables; --method tls does not need them.",
        )
    return made


def _least_squares(problem: Problem) -> tuple[Body, tuple[Sampled, ...]]:
    """The body that weights the equations, and the windows' equations with their weights."""
    windows = problem.of_role(Role.IDENTIFY)
    weights = problem.campaign.robot.nominal
    repeats = problem.recipe.reweight if problem.recipe.rows is BalanceRows.MARKER else 0
    sampled = _sampled(windows, weights)
    for _ in range(repeats):
        body = Body.from_vector(linear.fit(sampled).values)
        if not can_move(body):
            break
        weights = body
        sampled = _sampled(windows, weights)
    return weights, sampled


def _sampled(windows: Sequence[WindowEquations], weights: Body) -> tuple[Sampled, ...]:
    return linear.evened([Sampled.plain(e.decimated(weights), e.freedoms) for e in windows])


def _estimate(problem: Problem, windows: tuple[Sampled, ...], weights: Body) -> Estimate:
    full = linear.fit(windows)
    drop = _non_essential(full)
    reduced = linear.fit(windows, ~drop) if drop.any() else None
    blocks, rows = [linear.compressed(w) for w in windows], [w.rows for w in windows]
    notes: tuple[str, ...] = ()
    try:
        replicates = leave_one_out(blocks, rows, linear.solve)
    except RefusedError as error:
        replicates = None
        notes = (f"Without one of its windows the campaign identifies no body: {error.message}",)
    chi = np.concatenate([[1.0], full.values])
    error = linear.residual_sd(windows, full.values)
    s = np.linalg.svd(np.concatenate([w.W.reshape(-1, 10) for w in windows]), compute_uv=False)
    loose = _loose(full) & ~drop
    return Estimate(
        values=full.values,
        covariance=full.covariance,
        leave_one_out=replicates,
        sd_bootstrap=bootstrap_sd(blocks, rows, linear.solve),
        weights=weights,
        reduced=None if reduced is None else reduced.values,
        non_essential=_names(drop),
        sigma_W=error / float(np.linalg.norm(chi)),
        noise_ratio=_noise_ratio(problem, error),
        C=float((s[0] + 1) / s[-2]),
        doubtful=_names(loose),
        notes=notes,
    )


def _noise_ratio(problem: Problem, error: float) -> float | None:
    floors = [floor for e in problem.of_role(Role.IDENTIFY) if (floor := e.noise_floor) is not None]
    return error / float(np.sqrt(np.mean(np.square(floors)))) if floors else None


def _loose(found: LinearFit) -> np.ndarray:
    return found.sd * 100 > tls.WELL_IDENTIFIED_PERCENT * np.abs(found.values)


def _non_essential(found: LinearFit) -> np.ndarray:
    return _loose(found) & tls.near_zero(found.values)


def _names(marks: np.ndarray) -> tuple[str, ...]:
    return tuple(name for name, mark in zip(PARAMETER_NAMES, marks, strict=True) if mark)


def _hausman_note(problem: Problem, body: Body, weights: Body) -> list[str]:
    """Whether the regressor's noise biases least squares; says so where that cannot be tested."""
    if not can_move(body):
        return ["Whether regressor noise biases least squares cannot be tested: the body found cannot move."]
    mechanism = Mechanism(problem.campaign.robot, native=True)
    made = instrumented(problem, mechanism, problem.of_role(Role.IDENTIFY), body, weights)
    if not made.windows:
        return ["Whether regressor noise biases least squares cannot be tested: no window can be simulated."]
    return [*_missing_note(made), linear.hausman(linear.evened(made.windows)).sentence()]


def _missing_note(made: Instrumented) -> list[str]:
    if not made.missing:
        return []
    return [f"No instruments for window {', '.join(made.missing)}: the body found so far does not predict its motion."]
