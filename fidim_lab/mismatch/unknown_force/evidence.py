"""How much a family explains: ridge regression, with ridge strength and shape chosen by evidence.

Weights W ~ N(0, σ² s²) and a noise σ of which nothing is assumed give, with n numbers recorded,

    log-evidence(s) = −½ log |1 + s² A| − n/2 log(1 − q(s) / χ²),   q = bᵀ (A + s⁻²)⁻¹ b

(A, b: curvature and gradient with everything else projected out; Bishop 2006, §3.5). Windows left out in turn say
whether it holds beyond the windows that it was fitted to.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.optimize import minimize

from fidim_lab.mismatch.thresholds import SHARED
from fidim_lab.mismatch.unknown_force.family import Courses, Family
from fidim_lab.mismatch.unknown_force.knocks import knocks
from fidim_lab.mismatch.unknown_force.own_times import own_times
from fidim_lab.mismatch.unknown_force.responses import Responses
from fidim_lab.mismatch.unknown_force.thresholds import UNKNOWN_FORCE
from fidim_lab.model.side_by_side import side_by_side

STRENGTHS = np.logspace(-4, 3, 15)
"""prior sd of weights, relative to the size at which they would explain everything by themselves"""


@dataclass(frozen=True, eq=False)
class Weighed:
    """A family at its best shape."""

    courses: Courses
    shape: Float[np.ndarray, " shape"]
    weights: Float[np.ndarray, " Q"]
    prior_sd: Float[np.ndarray, " Q"]
    curvature: Float[np.ndarray, "Q Q"]
    """of half the sum of squares by the weights, everything else projected out"""
    gradient: Float[np.ndarray, " Q"]
    """downhill"""
    gain: float
    """χ² that it takes away"""
    log_evidence: float
    """against nothing"""
    effective: float = 0.0
    """number of weights that the data determine"""
    left_out: float = float("nan")
    """χ² that it takes away from windows, each predicted without itself; nan before it was asked for"""

    excess: float = 0.0
    """χ² beyond the noise, of which it takes its share"""
    phases: Float[np.ndarray, " W"] | None = None
    """rad, of each window, where it meets them at times of their own"""
    combined: Float[np.ndarray, "P Q"] | None = None
    """the family's weights by these, where these are fewer"""

    @property
    def explained(self) -> float:
        """Share of the excess that it takes away."""
        return self.gain / max(self.excess, 1e-9)

    @property
    def left_out_share(self) -> float:
        """The same of windows left out."""
        return self.left_out / max(self.excess, 1e-9)

    @property
    def family(self) -> Family:
        """The family that was compared."""
        return self.courses.family


@dataclass(frozen=True, eq=False)
class Evidence:
    """Windows' answers and the prior on what they share, ready to weigh families."""

    responses: Responses
    prior: Float[np.ndarray, "shared s"]
    """[J r]"""

    @property
    def shared(self) -> int:
        """Number of shared parameters."""
        return self.responses.shared

    @property
    def chi2(self) -> float:
        """Of the windows as they are."""
        return float(self.responses.gram[:, -1, -1].sum())

    @property
    def count(self) -> int:
        """Numbers recorded, less what was fitted."""
        return sum(one.count for one in self.responses.windows) - self.shared

    def best(self, courses: Courses) -> Weighed:
        """A family at the shape with the most evidence."""
        shapes = courses.family.shapes
        found = [(self._evidence(courses, shape), k) for k, shape in enumerate(shapes)]
        found.sort(key=lambda pair: -pair[0])
        top, shape = found[0][0], shapes[found[0][1]]
        steps = courses.family.steps
        if steps is not None:
            for _, k in found[: SHARED.runners_up]:
                simplex = np.vstack([shapes[k], shapes[k] + np.diag(steps)])
                options: Any = {
                    "initial_simplex": simplex,
                    "maxfev": UNKNOWN_FORCE.evidence_search,
                    "xatol": 1e-3,
                    "fatol": 0.1,
                }
                result = minimize(self._cost, shapes[k], args=(courses,), method="Nelder-Mead", options=options)
                if -float(result.fun) > top:
                    top, shape = -float(result.fun), np.asarray(result.x)
        return self.weigh(courses, shape)

    def weigh(self, courses: Courses, shape: Float[np.ndarray, " shape"]) -> Weighed:
        """A family at one shape."""
        grams = self._grams(courses, shape)
        return self._solved(courses, shape, grams)

    def with_left_out(self, one: Weighed) -> Weighed:
        """The same with what it predicts for windows left out."""
        grams = self._grams(one.courses, one.shape)
        found = [(self._left_out(grams.all, factor * one.prior_sd), factor) for factor in UNKNOWN_FORCE.evidence_weaker]
        left_out, factor = max(found)
        return replace(self._at_strength(one, factor * one.prior_sd), left_out=left_out)

    def _cost(self, shape: np.ndarray, courses: Courses) -> float:
        """What a search makes small."""
        return -self._evidence(courses, shape) if courses.family.allows(shape) else 1e12

    def _evidence(self, courses: Courses, shape: np.ndarray) -> float:
        return self._solved(courses, shape, self._grams(courses, shape)).log_evidence

    def _grams(self, courses: Courses, shape: np.ndarray) -> "_Grams":
        """Window by window, each in its own time where the family has one."""
        found, harmonics = self._in_step(courses, shape), courses.family.harmonics
        if not harmonics:
            return _Grams(found, None, 0.0)
        inflation = self.chi2 / max(1, self.count)
        if courses.family.knocks:
            directions = (found.shape[1] - 1 - self.shared) // (2 * harmonics + 1)
            own = knocks(found, self.shared, directions, float(shape[0]), inflation)
        else:
            own = own_times(found, self.shared, harmonics, inflation)
        return _Grams(own.grams, own.phases, own.cost, own.combined)

    def _in_step(self, courses: Courses, shape: np.ndarray) -> Float[np.ndarray, "W m m"]:
        """Of [shared, weights, residual], window by window."""
        given = self.responses
        bumps = given.coefficients(*courses.at(given.sample, shape))
        first, last = self.shared, given.gram.shape[1] - 1
        half = given.gram[:, :, first:last] @ bumps
        outer = np.r_[0:first, last]
        size = first + bumps.shape[2] + 1
        found = np.empty((len(bumps), size, size))
        place, mine = np.r_[0:first, size - 1], np.arange(first, size - 1)
        found[:, place[:, np.newaxis], place] = given.gram[:, outer[:, np.newaxis], outer]
        found[:, mine[:, np.newaxis], mine] = np.swapaxes(bumps, 1, 2) @ half[:, first:last]
        found[:, place[:, np.newaxis], mine] = half[:, outer]
        found[:, mine[:, np.newaxis], place] = np.swapaxes(half[:, outer], 1, 2)
        return found

    def _solved(self, courses: Courses, shape: np.ndarray, grams: "_Grams") -> Weighed:
        curvature, gradient, chi2 = self._projected(grams.all.sum(axis=0))
        values, vectors, scale = _modes(curvature)
        pull = vectors.T @ (gradient / scale)
        strengths = STRENGTHS * np.sqrt(max(chi2, 1.0))
        ridges = values + strengths[:, np.newaxis] ** -2
        shares = np.minimum((pull**2 / ridges).sum(axis=1) / chi2, 1 - 1e-9)
        logs = -0.5 * np.log(ridges * strengths[:, np.newaxis] ** 2).sum(axis=1) - 0.5 * self.count * np.log1p(-shares)
        k = int(np.argmax(logs))
        prior_sd = np.full(len(values), strengths[k] / scale)
        found = Weighed(
            courses,
            np.asarray(shape),
            np.zeros(0),
            prior_sd,
            curvature,
            gradient,
            gain=0.0,
            log_evidence=float(logs[k]) - grams.cost,
            excess=max(1.0, chi2 - self.count),
            phases=grams.phases,
            combined=grams.combined,
        )
        return self._at_strength(found, prior_sd)

    def _at_strength(self, one: Weighed, prior_sd: np.ndarray) -> Weighed:
        """The weights with another prior."""
        scaled = one.curvature * np.outer(prior_sd, prior_sd)
        values, vectors = np.linalg.eigh(scaled)
        values = np.maximum(values, 0.0)
        pull = vectors.T @ (one.gradient * prior_sd)
        inner = pull / (values + 1)
        return replace(
            one,
            weights=prior_sd * (vectors @ inner),
            prior_sd=prior_sd,
            gain=float(2 * inner @ pull - inner @ (values * inner)),
            effective=float((values / (values + 1)).sum()),
        )

    def _projected(self, gram: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
        """Curvature, downhill gradient and χ² with the shared parameters chosen best, within their prior."""
        s, prior = self.shared, self.prior
        inner = gram[:s, :s] + prior[:, :-1].T @ prior[:, :-1]
        cross = gram[:s, s:].copy()
        cross[:, -1] += prior[:, :-1].T @ prior[:, -1]
        scale = np.sqrt(np.diag(inner))
        inner, cross = inner / np.outer(scale, scale), cross / scale[:, np.newaxis]
        rest = gram[s:, s:] - cross.T @ np.linalg.solve(inner + 1e-13 * np.eye(s), cross)
        return rest[:-1, :-1], -rest[:-1, -1], max(float(rest[-1, -1]), 1e-9)

    def _left_out(self, grams: np.ndarray, prior_sd: np.ndarray) -> float:
        total, s = grams.sum(axis=0), self.shared
        folds = np.arange(len(grams)) % min(UNKNOWN_FORCE.evidence_folds, len(grams))
        gained = 0.0
        for fold in range(int(folds.max()) + 1):
            mine = grams[folds == fold].sum(axis=0)
            with_it = self._fitted(total - mine, prior_sd)
            without = np.zeros_like(with_it)
            without[:s] = self._fitted((total - mine)[np.ix_([*range(s), -1], [*range(s), -1])], np.zeros(0))
            gained += _squares(mine, without) - _squares(mine, with_it)
        return gained

    def _fitted(self, gram: np.ndarray, prior_sd: np.ndarray) -> np.ndarray:
        s = self.shared
        inner, right = gram[:-1, :-1].copy(), gram[:-1, -1].copy()
        inner[:s, :s] += self.prior[:, :-1].T @ self.prior[:, :-1]
        right[:s] += self.prior[:, :-1].T @ self.prior[:, -1]
        inner[range(s, len(inner)), range(s, len(inner))] += prior_sd**-2.0
        scale = np.sqrt(np.maximum(np.diag(inner), 1e-300))
        return np.linalg.lstsq(inner / np.outer(scale, scale), -right / scale, rcond=1e-13)[0] / scale


@dataclass(frozen=True, eq=False)
class _Grams:
    """All windows' sums of squares by a family at one shape."""

    all: Float[np.ndarray, "W m m"]
    """of [shared, weights, residual]"""
    phases: Float[np.ndarray, " W"] | None
    cost: float
    """nats, of the phases"""
    combined: Float[np.ndarray, "P Q"] | None = None
    """the family's weights by those that are weighed, where these are fewer"""


def _squares(gram: np.ndarray, step: np.ndarray) -> float:
    ends = np.append(step, 1.0)
    return float(ends @ gram @ ends)


def _modes(curvature: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Eigenvalues and vectors of A over its mean size, and the root of that; 1 where nothing that it does is seen."""
    square = float(np.trace(curvature)) / max(1, len(curvature))
    size = float(np.sqrt(square)) if square > 1e-200 else 1.0
    values, vectors = np.linalg.eigh(curvature / size**2)
    return np.maximum(values, 0.0), vectors, size


def weigh_all(evidence: Evidence, courses: Sequence[Courses]) -> tuple[Weighed, ...]:
    """Every family at its best, those first that explain most of windows left out."""

    def weighed(one: Courses) -> Weighed:
        return evidence.with_left_out(evidence.best(one))

    found = side_by_side([partial(weighed, one) for one in courses])
    return tuple(sorted(found, key=lambda one: -one.left_out))
