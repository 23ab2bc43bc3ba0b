"""The method `tls`: the paper's estimator on a whole problem, with the spread between its windows.

`tls.py` has the mathematics of one regressor; this stacks the windows, weights them, and asks how far to trust it.
"""

import numpy as np

from fidim_lab.data.records import PARAMETER_NAMES, Body, Role
from fidim_lab.errors import RefusedError
from fidim_lab.identification.equations import tls
from fidim_lab.identification.equations.consistency import can_move
from fidim_lab.identification.equations.estimate import Estimate, WindowAlone
from fidim_lab.identification.equations.problem import Problem, WindowEquations
from fidim_lab.identification.equations.uncertainty import bootstrap_sd, leave_one_out
from fidim_lab.identification.motion.recipe import BalanceRows

ALONE_GAP = 5.0
"""a window identifies a body alone when its s_9 is so many times its s_10"""


def estimate(problem: Problem) -> Estimate:
    """Total least squares over all usable `identify` windows (Eq. 25–34).

    Raises RefusedError when the windows do not identify a body.
    """
    windows = problem.of_role(Role.IDENTIFY)
    weights, blocks, rows = _weighted(problem, windows)
    W, count = np.concatenate(blocks), sum(rows)
    full = tls.solve(W, rows=count)
    reduced = tls.solve_essential(W, full, rows=count)
    dropped = tls.non_essential(full)
    notes: list[str] = []
    try:
        replicates = leave_one_out(blocks, rows, _values)
    except RefusedError as error:
        replicates = None
        notes.append(f"Without one of its windows the campaign identifies no body: {error.message}")
    return Estimate(
        values=full.values,
        covariance=full.covariance,
        leave_one_out=replicates,
        sd_bootstrap=bootstrap_sd(blocks, rows, _values),
        weights=weights,
        reduced=None if reduced is None else reduced.values,
        non_essential=tuple(n for n, drop in zip(PARAMETER_NAMES, dropped, strict=True) if drop),
        alone=_alone(windows, blocks, rows),
        sigma_W=full.sigma_W,
        noise_ratio=_noise_ratio(windows, full),
        C=full.C,
        scaling_effect=tls.scaling_effect(W, rows=count),
        doubtful=tls.doubtful(full),
        notes=tuple(notes),
    )


def _weighted(problem: Problem, windows: tuple[WindowEquations, ...]) -> tuple[Body, list[np.ndarray], list[int]]:
    """The body that weights the equations, each window's compressed block, and its number of independent rows.

    A body without a positive definite mass matrix cannot weight anything: then the last one that has one stays.
    """
    body = problem.campaign.robot.nominal
    repeats = problem.recipe.reweight if problem.recipe.rows is BalanceRows.MARKER else 0
    blocks, rows = _blocks(windows, body)
    for _ in range(repeats):
        found = Body.from_vector(_values(np.concatenate(blocks), sum(rows)))
        if not can_move(found):
            break
        body = found
        blocks, rows = _blocks(windows, body)
    return body, blocks, rows


def _blocks(windows: tuple[WindowEquations, ...], weights: Body) -> tuple[list[np.ndarray], list[int]]:
    stacked = [e.decimated(weights) for e in windows]
    rows = [len(W) * e.freedoms for W, e in zip(stacked, windows, strict=True)]
    return [tls.compress(W.reshape(-1, 10)) for W in stacked], rows


def _noise_ratio(windows: tuple[WindowEquations, ...], full: tls.TlsSolution) -> float | None:
    floors = [floor for e in windows if (floor := e.noise_floor) is not None]
    if not floors:
        return None
    return full.sigma_W * float(np.linalg.norm(full.chi)) / float(np.sqrt(np.mean(np.square(floors))))


def _values(W: np.ndarray, rows: int) -> np.ndarray:
    return tls.solve(W, rows=rows).values


def _alone(windows: tuple[WindowEquations, ...], blocks: list[np.ndarray], rows: list[int]) -> tuple[WindowAlone, ...]:
    found: list[WindowAlone] = []
    for equations, W, count in zip(windows, blocks, rows, strict=True):
        try:
            solution = tls.solve(W, rows=count)
        except RefusedError:
            continue
        if solution.singular_values[-2] > ALONE_GAP * solution.singular_values[-1]:
            found.append(WindowAlone(equations.window.id, solution.values))
    return tuple(found)
