"""Score (Lagrange multiplier) tests of all hypotheses at a fitted model, alone and in pairs.

Each window's own unknowns are eliminated by QR; what is left goes into one Gram matrix for all shared parameters,
scored parameters and the residual. Projecting out the body (with its prior) gives every hypothesis its gradient and
curvature; within its bounds, its best θ, the χ² that it would gain, and its evidence (Laplace) follow.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from jaxtyping import Float
from scipy.optimize import lsq_linear

from fidim_lab.effects.plausibility import Context
from fidim_lab.errors import OurBugError
from fidim_lab.identification.mle.fit import Fit
from fidim_lab.identification.mle.likelihood import Likelihood, Simulation
from fidim_lab.mismatch.columns import Scorer, WindowColumns
from fidim_lab.mismatch.hypotheses import Hypothesis

TINY = 1e-12


@dataclass(frozen=True, eq=False)
class Score:
    """What one hypothesis, or several together, would explain."""

    tried: tuple[Hypothesis, ...]
    theta: tuple[np.ndarray, ...]
    """best value of the scored parameters of each"""
    gain: float
    """χ² that it would take away"""
    log_evidence: float
    """half the gain less what its freedom costs (Laplace): of the completed model against the model as it is"""
    share: float = 0.0
    """of what the best possible combination of all hypotheses would take away"""

    @property
    def label(self) -> str:
        """For people."""
        return " + ".join(h.label for h in self.tried)

    @property
    def key(self) -> tuple[tuple[str, int | None], ...]:
        """Ids and cables."""
        return tuple(sorted(((h.effect.id, h.effect.cable) for h in self.tried), key=str))


@dataclass(frozen=True, eq=False)
class Projected:
    """Gradient and curvature of half the sum of squares by all scored parameters, everything else chosen best."""

    tried: tuple[Hypothesis, ...]
    slices: tuple[slice, ...]
    gradient: Float[np.ndarray, " Q"]
    curvature: Float[np.ndarray, "Q Q"]
    left: float
    """χ² of the model as it is"""
    dof: int
    inflation: float
    """χ²/dof: what is divided out before anything is called evidence"""


def project(scorer: Scorer, fit_: Fit, likelihood: Likelihood, simulation: Simulation) -> Projected:
    """The score of all hypotheses at a simulated optimum."""
    shared = len(simulation.point.shared)
    gram: np.ndarray | None = None
    rows = 0
    for window in scorer.columns(likelihood, simulation):
        part = _reduced_gram(window)
        gram = part if gram is None else gram + part
        rows += len(window.residual) - likelihood.own
    if gram is None:
        raise OurBugError("A score needs at least one fitted window.")
    prior = fit_.prior.rows(simulation.point.shared)
    gram[:shared, :shared] += prior[:, :-1].T @ prior[:, :-1]
    gram[:shared, -1] += prior[:, :-1].T @ prior[:, -1]
    gram[-1, :shared] = gram[:shared, -1]
    left = float(gram[-1, -1])
    scale = np.sqrt(np.maximum(np.diag(gram)[:shared], TINY))
    inner = gram[:shared, :shared] / np.outer(scale, scale)
    cross = gram[:shared, shared:] / scale[:, np.newaxis]
    rest = gram[shared:, shared:] - cross.T @ np.linalg.solve(inner + 1e-13 * np.eye(shared), cross)
    return Projected(
        tried=scorer.tried.every,
        slices=scorer.slices,
        gradient=-rest[:-1, -1],
        curvature=rest[:-1, :-1],
        left=left,
        dof=rows,
        inflation=max(1.0, left / max(1, rows)),
    )


def _reduced_gram(window: WindowColumns) -> np.ndarray:
    basis = np.linalg.qr(window.by_own)[0]
    rest = np.column_stack([window.by_shared, window.by_scored, window.residual])
    rest -= basis @ (basis.T @ rest)
    return rest.T @ rest


def single_scores(found: Projected, context: Context) -> tuple[Score, ...]:
    """Every hypothesis alone, the most evident first."""
    return _sorted(_score(found, (k,), context) for k in range(len(found.tried)))


def pair_scores(found: Projected, context: Context, most: int = 60) -> tuple[Score, ...]:
    """All pairs of the hypotheses that alone, or as a complement, explain most; the most evident first."""
    alone = single_scores(found, context)
    index = {id(h): k for k, h in enumerate(found.tried)}
    best = list(dict.fromkeys(index[id(score.tried[0])] for score in _one_of_each(alone)))[:most]
    pairs = ((a, b) for a, b in combinations(best, 2) if _may_pair(found.tried[a], found.tried[b]))
    return _sorted(_score(found, pair, context) for pair in pairs)


def explained_share(found: Projected, a: Hypothesis, b: Hypothesis) -> float:
    """How much of the influence of `a`'s own direction `b` can imitate (0…1), everything else being adjusted."""
    index = {id(h): k for k, h in enumerate(found.tried)}
    at_a, at_b = found.slices[index[id(a)]], found.slices[index[id(b)]]
    theta = _best(found, (index[id(a)],), None)[0]
    size = theta @ found.curvature[at_a, at_a] @ theta
    cross = found.curvature[at_b, at_a] @ theta
    return float(cross @ _solve(found.curvature[at_b, at_b], cross) / max(size, TINY))


def _one_of_each(scores: Sequence[Score]) -> list[Score]:
    """The best scan point of each effect."""
    seen: dict[object, Score] = {}
    for score in scores:
        seen.setdefault(score.tried[0].effect, score)
    return list(seen.values())


def _may_pair(a: Hypothesis, b: Hypothesis) -> bool:
    """Two variants of the same thing are no pair; the same fault on two cables is."""
    same = a.effect.id == b.effect.id
    return not (same and (a.effect.cable is None or b.effect.cable is None or a.effect.cable == b.effect.cable))


def _sorted(scores: Iterable[Score]) -> tuple[Score, ...]:
    return tuple(sorted(scores, key=lambda score: -score.log_evidence))


def _score(found: Projected, members: tuple[int, ...], context: Context) -> Score:
    tried = tuple(found.tried[k] for k in members)
    theta, gain = _best(found, members, context)
    parts = np.split(theta, np.cumsum([len(h.scored) for h in tried])[:-1])
    prior = np.concatenate([h.prior_sd for h in tried])
    index = _columns(found, members)
    freedom = prior[:, np.newaxis] * found.curvature[np.ix_(index, index)] * prior / found.inflation
    cost = 0.5 * float(np.linalg.slogdet(np.eye(len(index)) + freedom)[1])
    surprise = 0.5 * float(((theta / prior) ** 2).sum())
    evidence = 0.5 * gain / found.inflation - cost - surprise
    return Score(tried, tuple(parts), gain, evidence, gain / max(found.left - found.dof, TINY))


def _columns(found: Projected, members: tuple[int, ...]) -> np.ndarray:
    return np.concatenate([np.arange(found.slices[k].start, found.slices[k].stop) for k in members])


def _best(found: Projected, members: tuple[int, ...], context: Context | None) -> tuple[np.ndarray, float]:
    """Best θ within bounds and the χ² it gains."""
    index = _columns(found, members)
    curvature, gradient = found.curvature[np.ix_(index, index)], found.gradient[index]
    theta = _solve(curvature, gradient)
    if context is not None:
        bounds = [h.effect.bounds(context) for h in (found.tried[k] for k in members)]
        chosen = [list(found.tried[k].scored) for k in members]
        low = np.concatenate([b[0][c] for b, c in zip(bounds, chosen, strict=True)])
        high = np.concatenate([b[1][c] for b, c in zip(bounds, chosen, strict=True)])
        if (theta < low).any() or (theta > high).any():
            theta = _bounded(curvature, gradient, low, high)
    return theta, float(2 * gradient @ theta - theta @ curvature @ theta)


def _solve(curvature: np.ndarray, gradient: np.ndarray) -> np.ndarray:
    scale = np.sqrt(np.maximum(np.diag(curvature), TINY))
    return np.linalg.lstsq(curvature / np.outer(scale, scale), gradient / scale, rcond=1e-10)[0] / scale


def _bounded(curvature: np.ndarray, gradient: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    scale = np.sqrt(np.maximum(np.diag(curvature), TINY))
    values, vectors = np.linalg.eigh(curvature / np.outer(scale, scale))
    root = np.sqrt(np.maximum(values, TINY))
    matrix = root[:, np.newaxis] * vectors.T
    right = (vectors.T @ (gradient / scale)) / root
    return lsq_linear(matrix, right, bounds=(low * scale, high * scale)).x / scale
