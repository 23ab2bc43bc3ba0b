"""Cross-validation of an identified body, window by window: σ⊥ (Eq. 50) and the predicted trajectory."""

from dataclasses import dataclass

import numpy as np

from fidim_lab.data.records import Body
from fidim_lab.identification.equations.estimate import Estimate
from fidim_lab.identification.equations.problem import Problem, UnusedWindow, WindowEquations
from fidim_lab.identification.motion.trajectory import predict
from fidim_lab.identification.results.result import Residual, WindowVerdict
from fidim_lab.model.regressor import parameter_vector


@dataclass(frozen=True)
class Checks:
    """How thoroughly to look at each window."""

    predict: bool = True
    """simulate every window from its fitted initial state (half a second for 10 s of recording)"""


THOROUGH = Checks()
QUICK = Checks(predict=False)


def residual(equations: WindowEquations, body: Body, weights: Body) -> Residual:
    """ε = W χ over all samples of the window; `weights` must be the body that weighted the estimate's equations."""
    return Residual(equations.times, equations.rows(weights) @ parameter_vector(body))


def sigma_perp(found: Residual) -> float:
    """σ⊥ = √(εᵀε / n_cv) with ε = W χ over all n_cv samples of the window (Eq. 50).

    A window that is as good as the identified ones has σ⊥ ≈ √λ ‖χ‖ σ_W, because a sample has λ independent equations:
    see `expected_sigma_perp`.
    """
    return float(np.sqrt((found.epsilon**2).sum() / len(found.epsilon)))


def expected_sigma_perp(sigma_W: float, body: Body, freedoms: int) -> float:
    """√λ ‖χ‖ σ_W: what σ⊥ is where the model holds as well as in the windows it was identified from."""
    return float(np.sqrt(freedoms) * np.linalg.norm(parameter_vector(body)) * sigma_W)


def verdicts(problem: Problem, estimate: Estimate, checks: Checks) -> tuple[WindowVerdict, ...]:
    """One verdict for every window of the campaign, in its order."""
    by_id = {e.window.id: _judge(problem, e, estimate, checks) for e in problem.equations}
    by_id |= {u.window.id: _unused(u) for u in problem.unused}
    return tuple(by_id[w.id] for w in problem.campaign.windows if w.id in by_id)


def _judge(problem: Problem, equations: WindowEquations, estimate: Estimate, checks: Checks) -> WindowVerdict:
    measured = equations.measured
    left = residual(equations, estimate.body, estimate.weights)
    found = predict(problem.mechanism, estimate.body, measured) if checks.predict else None
    return WindowVerdict(
        id=measured.window.id,
        role=measured.window.role,
        used=True,
        variant=measured.variant.value,
        samples=len(measured.samples),
        sigma_perp=sigma_perp(left),
        rms_mm=None if found is None else found.rms * 1e3,
        chi2_per_dof=None if found is None else found.chi2_per_dof,
        conditioning=float(measured.conditioning.max()),
        notes=measured.notes,
        residual=left,
        prediction=found,
    )


def _unused(unused: UnusedWindow) -> WindowVerdict:
    window = unused.window
    return WindowVerdict(window.id, window.role, used=False, notes=(unused.reason,))
