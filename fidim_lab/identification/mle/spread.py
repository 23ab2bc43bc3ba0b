"""Uncertainty of the parameters: the information matrix, the spread between windows, and what is not determined.

All from the windows' reduced tables at the optimum (`normal`): resampling windows costs one small least squares each.
The nominal covariance believes noise and model; bootstrap and jackknife believe neither, but know only what differs
from window to window.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.stats import chi2

from fidim_lab.data.records import PARAMETER_NAMES
from fidim_lab.identification.equations.uncertainty import DRAWS, MIN_WINDOWS, SEED
from fidim_lab.identification.mle.trajectories.normal import Reduced
from fidim_lab.model.sensitivity.equations import BODY

LOOSE_COMBINATION = 0.1
"""of what is plausible beforehand: a combination of parameters known no better is not determined"""
ROUNDING = 1e-6
"""of the largest variance that a window takes away: what is smaller is lost in the difference of covariances"""
PART = 0.2
"""share of the largest under which a parameter's part in a combination is not worth naming"""


@dataclass(frozen=True, eq=False)
class Quadratic:
    """The sum of squares near the optimum as a function of the shared parameters."""

    information: Float[np.ndarray, "shared shared"]
    gradient: Float[np.ndarray, " shared"]
    """half of it"""

    @staticmethod
    def of(tables: Reduced, prior_rows: Float[np.ndarray, "shared s"] | None = None) -> "Quadratic":
        """The sum over windows; of the data alone without rows of a prior."""
        rows = tables[:, :-1].reshape(-1, tables.shape[2])
        rows = rows if prior_rows is None else np.vstack([rows, prior_rows])
        return Quadratic(rows[:, :-1].T @ rows[:, :-1], rows[:, :-1].T @ rows[:, -1])

    def step(self, free: Bool[np.ndarray, " shared"], held: Float[np.ndarray, " shared"]) -> np.ndarray:
        """To the optimum over the free parameters, the others moved by `held`."""
        moved = np.where(free, 0.0, held)
        right = -(self.gradient + self.information @ moved)[free]
        inner = self.information[np.ix_(free, free)]
        scale = 1 / np.sqrt(np.diag(inner))
        moved[free] = scale * np.linalg.solve(inner * np.outer(scale, scale), scale * right)
        return moved

    @property
    def covariance(self) -> Float[np.ndarray, "shared shared"]:
        """Inverse of the information; positive definite even where rounding hides its smallest eigenvalue."""
        scale = 1 / np.sqrt(np.diag(self.information))
        values, axes = np.linalg.eigh(self.information * np.outer(scale, scale))
        root = scale[:, np.newaxis] * axes / np.sqrt(np.maximum(values, np.finfo(float).eps * values[-1]))
        return root @ root.T


@dataclass(frozen=True)
class Combination:
    """A direction in parameter space that the data leave open."""

    weights: tuple[tuple[str, float], ...]
    """parameter and its part, each in units of what is plausible for it, largest first"""
    known: float
    """sd along it, as a share of what is plausible beforehand; 1: the data say nothing"""

    def __str__(self) -> str:
        own = [f"{weight:+.2g} {name}" for name, weight in self.weights if name in PARAMETER_NAMES]
        beside = " with what is fitted beside the body" if len(own) < len(self.weights) else ""
        return f"{' '.join(own).removeprefix('+')}{beside} (in units of what is plausible)"


def leave_one_out(
    tables: Reduced, prior_rows: Float[np.ndarray, "shared s"], values: Float[np.ndarray, " shared"]
) -> Float[np.ndarray, "W shared"] | None:
    """The estimate without each window in turn, to first order; None with fewer than three windows."""
    count = len(tables)
    if count < MIN_WINDOWS:
        return None
    kept = [np.delete(np.arange(count), out) for out in range(count)]
    return np.array([values + _refitted(tables[chosen], prior_rows) for chosen in kept])


def agreement(tables: Reduced, prior_rows: Float[np.ndarray, "shared s"]) -> float:
    """Probability that windows of one body differ as much as these; 1 with fewer than three.

    Leaving a window out moves the body by no more than the covariance grows, if all show the same one. The least
    probable window's, times their number (Bonferroni). tables: in units of the noise that there is.
    """
    moves = leave_one_out(tables, prior_rows, -_refitted(tables, prior_rows))
    if moves is None:
        return 1.0
    together = Quadratic.of(tables, prior_rows).covariance[:BODY, :BODY]
    scale = 1 / np.sqrt(np.diag(together))
    least = 1.0
    for w, moved in enumerate(moves[:, :BODY]):
        without = Quadratic.of(np.delete(tables, w, axis=0), prior_rows).covariance[:BODY, :BODY]
        values, axes = np.linalg.eigh((without - together) * np.outer(scale, scale))
        shown = values > ROUNDING * values[-1]
        distance = (axes.T @ (scale * moved))[shown] ** 2 / values[shown]
        least = min(least, float(chi2.sf(distance.sum(), shown.sum())))
    return min(1.0, len(tables) * least)


def bootstrap_sd(
    tables: Reduced, prior_rows: Float[np.ndarray, "shared s"], *, draws: int = DRAWS, seed: int = SEED
) -> Float[np.ndarray, " shared"] | None:
    """Standard deviation over campaigns whose windows are weighted at random; None with fewer than three windows.

    Rubin's (1981) bootstrap: weights from the flat Dirichlet distribution instead of the multinomial one, because a
    draw that repeats one of few windows and leaves the others out identifies no body. Scaled by √((W+1)/(W−1)), with
    which the variance of a mean of W windows is unbiased.
    """
    count = len(tables)
    if count < MIN_WINDOWS:
        return None
    weights = count * np.random.default_rng(seed).dirichlet(np.ones(count), size=draws)
    found = [_refitted(tables * np.sqrt(weight)[:, np.newaxis, np.newaxis], prior_rows) for weight in weights]
    return np.sqrt((count + 1) / (count - 1)) * np.std(found, axis=0, ddof=1)


def open_combinations(
    covariance: Float[np.ndarray, "shared shared"], plausible: Float[np.ndarray, " shared"], names: tuple[str, ...]
) -> tuple[Combination, ...]:
    """Combinations of parameters whose sd is above a tenth of their plausible range; worst first."""
    values, directions = np.linalg.eigh(covariance / np.outer(plausible, plausible))
    found: list[Combination] = []
    for value, direction in zip(values[::-1], directions.T[::-1], strict=True):
        if value < LOOSE_COMBINATION**2:
            break
        largest = np.abs(direction).max()
        order = [k for k in np.argsort(-np.abs(direction)) if abs(direction[k]) >= PART * largest]
        sign = np.sign(direction[order[0]])
        parts = tuple((names[k], float(sign * direction[k])) for k in order)
        found.append(Combination(parts, float(np.sqrt(value))))
    return tuple(found)


def _refitted(tables: Reduced, prior_rows: np.ndarray) -> np.ndarray:
    """One Gauss–Newton step from the optimum of all windows to that of those given."""
    quadratic = Quadratic.of(tables, prior_rows)
    nothing = np.zeros(len(quadratic.gradient))
    return quadratic.step(np.ones(len(nothing), dtype=bool), nothing)
