"""Score (Lagrange multiplier) tests of all hypotheses at a fitted model, alone and in pairs.

Each window's own unknowns are eliminated by QR; what is left goes into one Gram matrix for all shared parameters,
scored parameters and the residual. Projecting out the body (with its prior) gives every hypothesis its gradient and
curvature; within its bounds, its best θ, the χ² that it would gain, and its evidence (Laplace) follow.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations

import numpy as np
from jaxtyping import Float
from scipy.optimize import lsq_linear

from fidim_lab.effects.plausibility import Context
from fidim_lab.errors import OurBugError
from fidim_lab.identification.mle.fit import Fit
from fidim_lab.identification.mle.trajectories.likelihood import Likelihood, Simulation
from fidim_lab.mismatch.linearised.columns import ResidualColumns, Scorer
from fidim_lab.mismatch.linearised.columns_sprung import SprungScorer
from fidim_lab.mismatch.linearised.hypotheses import PERIODIC, Hypothesis
from fidim_lab.mismatch.scores.thresholds import SCORES
from fidim_lab.model.side_by_side import side_by_side

AT_ONCE = 64
"""columns that are projected together: all at once would need another copy of them all"""


@dataclass(frozen=True, eq=False)
class Score:
    """The score of one hypothesis, or of several together."""

    tried: tuple[Hypothesis, ...]
    theta: tuple[np.ndarray, ...]
    """best value of the scored parameters of each"""
    gain: float
    """χ² that it would take away"""
    log_evidence: float
    """half the gain less what its freedom costs (Laplace): of the completed model against the model as it is"""
    share: float = 0.0
    """of what the best possible combination of all hypotheses would take away"""
    phases: Float[np.ndarray, " W"] | None = None
    """of a periodic effect in each window, rad; None where it has none of its own"""

    @property
    def label(self) -> str:
        """For people."""
        return " + ".join(h.label for h in self.tried)

    @property
    def size(self) -> int:
        """Parameters that a fit of it has."""
        return sum(len(h.effect.parameters) for h in self.tried)

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
    gram: Float[np.ndarray, "G G"]
    """of shared parameters, scored parameters and residual, the windows' own unknowns eliminated"""


@dataclass(frozen=True, eq=False)
class WindowGram:
    """One window's information, to first order about one value of the shared parameters."""

    gram: Float[np.ndarray, "G G"]
    """of shared parameters, scored parameters and residual, its own unknowns eliminated"""
    count: int
    """rows of the residual less own unknowns"""
    shared: Float[np.ndarray, " shared"]

    def at(self, shared: Float[np.ndarray, " shared"]) -> Float[np.ndarray, "G G"]:
        """The matrix with the residual that it has, to first order, at another value not far away."""
        step, gram = shared - self.shared, self.gram.copy()
        gram[:, -1] += gram[:, : len(step)] @ step
        gram[-1] += step @ gram[: len(step)]
        return gram


def project(scorer: Scorer | SprungScorer, fit_: Fit, likelihood: Likelihood, simulation: Simulation) -> Projected:
    """The score of all hypotheses at a simulated optimum."""
    grams = window_grams(scorer, likelihood, simulation)
    if not grams:
        raise OurBugError("A score needs at least one fitted window.")
    return projected(scorer, fit_, grams)


def window_grams(
    scorer: Scorer | SprungScorer, likelihood: Likelihood, simulation: Simulation, windows: Sequence[int] | None = None
) -> list[WindowGram]:
    """Of each window, in the order in which the simulation has them; `windows`: of these alone."""
    steady = sum(len(h.scored) for h in scorer.tried.direct)
    tasks = scorer.tasks(likelihood, simulation, windows)
    shared = simulation.point.shared
    found = side_by_side([partial(_reduced_gram, task, steady) for task in tasks])
    return [WindowGram(gram, count - likelihood.own, shared) for gram, count in found]


def projected(scorer: Scorer | SprungScorer, fit_: Fit, grams: Sequence[WindowGram]) -> Projected:
    """The score of all hypotheses from what the windows say, at the fit's shared parameters."""
    values, rows = fit_.values, sum(one.count for one in grams)
    gram = np.zeros_like(grams[0].gram)
    for one in grams:
        gram += one.gram if np.array_equal(one.shared, values) else one.at(values)
    shared = len(values)
    prior = fit_.prior.rows(values)
    gram[:shared, :shared] += prior[:, :-1].T @ prior[:, :-1]
    gram[:shared, -1] += prior[:, :-1].T @ prior[:, -1]
    gram[-1, :shared] = gram[:shared, -1]
    left = float(gram[-1, -1])
    rest = eliminated(gram, np.arange(shared), np.arange(shared, len(gram)))
    return Projected(
        tried=scorer.tried.every,
        slices=scorer.tried.slices,
        gradient=-rest[:-1, -1],
        curvature=rest[:-1, :-1],
        left=left,
        dof=rows,
        inflation=max(1.0, left / max(1, rows)),
        gram=gram,
    )


def _reduced_gram(compute: Callable[[], ResidualColumns], steady: int) -> tuple[np.ndarray, int]:
    """The Gram matrix of a window without its own unknowns, and the number of its rows.

    Of periodic hypotheses with each other it is 0, which saves most.
    """
    window = compute()
    basis = np.linalg.qr(window.by_own)[0]
    first = window.by_shared.shape[1] + steady
    rest = np.column_stack([window.by_shared, window.by_scored, window.residual])
    del window  # as large as this copy of it
    for columns in range(0, rest.shape[1], AT_ONCE):
        some = rest[:, columns : columns + AT_ONCE]
        some -= basis @ (basis.T @ some)
    left, right = np.column_stack([rest[:, :first], rest[:, -1:]]), rest[:, first:-1]
    gram = np.zeros((rest.shape[1],) * 2)
    index = np.concatenate([np.arange(first), [len(gram) - 1]])
    gram[index] = left.T @ rest
    gram[first:-1, index] = gram[index, first:-1].T
    for k in range(0, right.shape[1], 2 * 3):
        own = slice(first + k, first + k + 2 * 3)
        gram[own, own] = rest[:, own].T @ rest[:, own]
    return gram, len(rest)


def single_scores(found: Projected, context: Context) -> tuple[Score, ...]:
    """Every hypothesis alone, the most evident first."""
    return _sorted(score_together(found, (k,), context) for k in range(len(found.tried)))


def pair_scores(found: Projected, context: Context, most: int = 12) -> tuple[Score, ...]:
    """The best pairs of hypotheses, the most evident first; of each effect the scan point that is best alone.

    All pairs are looked at without bounds, which can only be better; the bounds cost time and are kept by the best.
    """
    index = {id(h): k for k, h in enumerate(found.tried)}
    best = [index[id(score.tried[0])] for score in _one_of_each(single_scores(found, context))]
    pairs = [pair for pair in combinations(best, 2) if _may_pair(found.tried[pair[0]], found.tried[pair[1]])]
    hopes = sorted(((_hope(found, pair), pair) for pair in pairs), reverse=True)
    scores: list[Score] = []
    for hope, pair in hopes:
        if len(scores) >= most and hope < sorted(score.log_evidence for score in scores)[-most]:
            break
        scores.append(score_together(found, pair, context))
        if len(scores) == SCORES.longest_look:
            break
    return _sorted(scores)[:most]


def _hope(found: Projected, members: tuple[int, ...]) -> float:
    """Log-evidence without bounds."""
    _, gain = _best(found, members, None)
    return 0.5 * gain / found.inflation - freedom(found, members)[0]


def eliminated(gram: np.ndarray, outside: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """The Gram matrix of some columns (indices `inside`) with others (`outside`) adjusted to each of them."""
    scale = np.sqrt(np.maximum(np.diag(gram)[outside], 1e-12))
    inner = gram[np.ix_(outside, outside)] / np.outer(scale, scale) + 1e-13 * np.eye(len(outside))
    cross = gram[np.ix_(outside, inside)] / scale[:, np.newaxis]
    return gram[np.ix_(inside, inside)] - cross.T @ np.linalg.solve(inner, cross)


def _one_of_each(scores: Sequence[Score]) -> list[Score]:
    """The best scan point of each effect."""
    seen: dict[object, Score] = {}
    for score in scores:
        seen.setdefault(score.tried[0].effect, score)
    return list(seen.values())


def _may_pair(a: Hypothesis, b: Hypothesis) -> bool:
    """Two variants of the same thing are no pair; the same fault on two cables is."""
    if a.effect.id in PERIODIC and b.effect.id in PERIODIC:
        return False
    same = a.effect.id == b.effect.id
    return not (same and (a.effect.cable is None or b.effect.cable is None or a.effect.cable == b.effect.cable))


def _sorted(scores: Iterable[Score]) -> tuple[Score, ...]:
    return tuple(sorted(scores, key=lambda score: -score.log_evidence))


def score_together(found: Projected, members: tuple[int, ...], context: Context) -> Score:
    """Of some hypotheses (indices into `found.tried`) at once, each within its bounds."""
    tried = tuple(found.tried[k] for k in members)
    theta, gain = _best(found, members, context)
    parts = np.split(theta, np.cumsum([len(h.scored) for h in tried])[:-1])
    cost, prior = freedom(found, members)
    surprise = 0.5 * float(((theta / prior) ** 2).sum())
    evidence = 0.5 * gain / found.inflation - cost - surprise
    return Score(tried, tuple(parts), gain, evidence, gain / max(found.left - found.dof, 1e-12))


def freedom(found: Projected, members: tuple[int, ...]) -> tuple[float, np.ndarray]:
    """The penalty for the parameters of some hypotheses (nats), and their prior standard deviations."""
    prior = np.concatenate([found.tried[k].prior_sd for k in members])
    index = _columns(found, members)
    wide = prior[:, np.newaxis] * found.curvature[np.ix_(index, index)] * prior / found.inflation
    chosen = sum(found.tried[k].choice for k in members)
    return 0.5 * float(np.linalg.slogdet(np.eye(len(index)) + wide)[1]) + chosen, prior


def _columns(found: Projected, members: tuple[int, ...]) -> np.ndarray:
    return np.concatenate([np.arange(found.slices[k].start, found.slices[k].stop) for k in members])


def _best(found: Projected, members: tuple[int, ...], context: Context | None) -> tuple[np.ndarray, float]:
    """Best θ within bounds and the χ² it gains."""
    index = _columns(found, members)
    curvature, gradient = found.curvature[np.ix_(index, index)], found.gradient[index]
    if context is None:
        theta = _solve(curvature, gradient)
    else:
        bounds = [h.effect.bounds(context) for h in (found.tried[k] for k in members)]
        chosen = [list(found.tried[k].scored) for k in members]
        low = np.concatenate([b[0][c] for b, c in zip(bounds, chosen, strict=True)])
        high = np.concatenate([b[1][c] for b, c in zip(bounds, chosen, strict=True)])
        theta = bounded(curvature, gradient, low, high)
    return theta, float(2 * gradient @ theta - theta @ curvature @ theta)


def _solve(curvature: np.ndarray, gradient: np.ndarray) -> np.ndarray:
    scale = np.sqrt(np.maximum(np.diag(curvature), 1e-12))
    return np.linalg.lstsq(curvature / np.outer(scale, scale), gradient / scale, rcond=1e-10)[0] / scale


def imitated(curvature: np.ndarray, cross: np.ndarray, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, float]:
    """The θ within bounds of an effect that comes nearest to another, and what of the other's θᵀ C θ it takes up.

    curvature: of the effect (Q, Q); cross: its curvature with the other, times the other's θ.
    """
    if len(cross) == 1:  # most are; the general way takes milliseconds
        best = np.clip(cross / np.maximum(np.diag(curvature), 1e-12), low, high)
    else:
        best = bounded(curvature, cross, low, high)
    return best, float(2 * cross @ best - best @ curvature @ best)


def bounded(curvature: np.ndarray, gradient: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """The θ within bounds that minimises ½ θᵀ C θ − gᵀ θ."""
    theta = _solve(curvature, gradient)
    if (theta >= low).all() and (theta <= high).all():
        return theta
    high = np.maximum(high, low + 1e-12)  # no room at all, where no tension makes any friction possible
    scale = np.sqrt(np.maximum(np.diag(curvature), 1e-12))
    values, vectors = np.linalg.eigh(curvature / np.outer(scale, scale))
    root = np.sqrt(np.maximum(values, 1e-12))
    matrix = root[:, np.newaxis] * vectors.T
    right = (vectors.T @ (gradient / scale)) / root
    return lsq_linear(matrix, right, bounds=(low * scale, high * scale)).x / scale
