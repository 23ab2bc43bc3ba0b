"""W χ = 0 with the mass column on the right: least squares, instrumental variables, and the test between them.

    y = −W_1 = X θ,  X = W_2:10        least squares   θ = (XᵀX)⁻¹ Xᵀ y
                                       instruments     θ = (ZᵀX)⁻¹ Zᵀ y

Least squares takes X as exact. X is made of measured poses and their derivatives, so its noise also sits in the error
of the equations, and θ is biased. Instruments Z, here the same regressor on *simulated* motion, go with X but know
nothing of its noise (Janot et al. 2009). `hausman` asks whether it matters (Durbin, Wu and Hausman; Janot et al. 2016).

Errors of neighbouring samples are not independent after the low-pass; covariances are of the Newey–West kind, which
holds for any noise whose correlation fades within some samples.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.special import chdtrc

from fidim_lab.data.records import PARAMETER_NAMES
from fidim_lab.errors import RefusedError

Nine = Float[np.ndarray, "9"]
Square = Float[np.ndarray, "9 9"]

SIGNIFICANT = 0.01
"""p below which hypothesis zero is given up"""
EVENING = 2
"""rounds of weighting: in the first a bad window still draws the solution to itself"""
RANK_TOLERANCE = 1e-9
"""of the largest singular value of X with columns of norm 1: below it the motion leaves a parameter open"""


@dataclass(frozen=True, eq=False)
class Sampled:
    """The equations of one window at the samples that are used."""

    W: Float[np.ndarray, "N K 10"]
    Z: Float[np.ndarray, "N K 9"]
    """instruments; X itself for least squares"""
    rank: int
    """λ: how many of the K equations of a sample are independent"""

    @staticmethod
    def plain(W: Float[np.ndarray, "N K 10"], rank: int) -> "Sampled":
        """For least squares: every column of X is its own instrument."""
        return Sampled(W, W[..., 1:], rank)

    @property
    def rows(self) -> int:
        """Number of independent equations."""
        return len(self.W) * self.rank

    def scaled(self, factor: float) -> "Sampled":
        """The same equations with another weight."""
        return Sampled(factor * self.W, factor * self.Z, self.rank)


@dataclass(frozen=True, eq=False)
class LinearFit:
    """One solution with its uncertainty."""

    values: Nine
    """m, m²; 0 for a parameter that was left out"""
    covariance: Square
    """Newey–West; 0 for a parameter that was left out"""

    @property
    def sd(self) -> Nine:
        """Standard deviations."""
        return np.sqrt(np.diag(self.covariance))


@dataclass(frozen=True)
class Hausman:
    """The Durbin–Wu–Hausman test: hypothesis zero is that no column of X goes with the errors of the equations.

    Noise of the regressor is a part of those errors, so with few other errors the test sees it at any size; how far it
    moves the answer is the other half of the verdict.
    """

    statistic: float
    """χ² distributed under hypothesis zero"""
    dof: int
    p: float
    shift: float
    """largest |least squares − instruments| of the same equations, in standard deviations of the latter"""
    parameter: str
    """whose shift that is"""

    @property
    def biased(self) -> bool:
        """Whether least squares is biased by more than its uncertainty."""
        return self.p < SIGNIFICANT and self.shift > 1.0

    def sentence(self) -> str:
        """The verdict for a person, with statistic, degrees of freedom and p."""
        p = "p < 1e-12" if self.p < 1e-12 else f"p = {self.p:.2g}"
        figures = f"Durbin–Wu–Hausman: χ² = {self.statistic:.1f} with {self.dof} degrees of freedom, {p}"
        if self.p >= SIGNIFICANT:
            return f"No sign that noise in the regressor biases least squares ({figures})."
        if not self.biased:
            return (
                f"Noise in the regressor correlates with the errors of the equations ({figures}), but it moves least "
                f"squares by at most {self.shift:.2f} sd ({self.parameter}): it does not matter here."
            )
        return (
            "Least squares is biased: noise in the regressor, or physics that the model lacks, correlates with the "
            f"errors of the equations ({figures}) and moves {self.parameter} by {self.shift:.1f} sd. "
            "Instruments (iv) remove the first, not the second."
        )


def fit(windows: Sequence[Sampled], active: np.ndarray | None = None) -> LinearFit:
    """θ and its covariance from all windows; `active` (9,) of bool: which parameters are estimated.

    Raises RefusedError when there are too few equations or the motion leaves a parameter open.
    """
    kept = np.ones(9, dtype=bool) if active is None else active
    values = solve(np.concatenate([stacked(w) for w in windows]), sum(w.rows for w in windows), kept)
    return LinearFit(values, _covariance(windows, values, kept))


def stacked(window: Sampled) -> Float[np.ndarray, "rows 19"]:
    """[W Z] of one window as plain rows."""
    return np.concatenate([window.W, window.Z], axis=2).reshape(-1, 19)


def compressed(window: Sampled) -> Float[np.ndarray, "rows 19"]:
    """The triangular factor of [W Z]: `solve` answers the same from it, and windows are left out at no cost."""
    rows = stacked(window)
    return np.linalg.qr(rows).R if len(rows) > 19 else rows


def solve(rows: Float[np.ndarray, "rows 19"], count: int, active: np.ndarray | None = None) -> Nine:
    """θ from stacked [W Z] (or their triangular factors) that stand for `count` independent equations.

    Raises as `fit`.
    """
    kept = np.ones(9, dtype=bool) if active is None else active
    X, y, Z = rows[:, 1:10][:, kept], -rows[:, 0], rows[:, 10:][:, kept]
    if count <= kept.sum():
        raise RefusedError(f"{count} equations for {kept.sum()} unknowns: too few usable samples to identify a body.")
    if not np.isfinite(rows).all():
        raise RefusedError(
            "The regressor has entries that are not numbers.", hint="Look at the samples that were used."
        )
    _refuse_unexcited(X, kept)
    values = np.zeros(9)
    # Columns of norm 1: the normal equations would otherwise lose digits to the units alone.
    sx, sz = np.linalg.norm(X, axis=0), np.linalg.norm(Z, axis=0)
    Q, R = np.linalg.qr(Z / np.where(sz > 0, sz, 1.0))
    if np.abs(np.diag(R)).min() < RANK_TOLERANCE:
        raise RefusedError("The simulated motion does not excite every parameter: it gives no instruments.")
    values[kept] = np.linalg.solve(Q.T @ (X / sx), Q.T @ y) / sx
    return values


def residual(window: Sampled, values: Nine) -> Float[np.ndarray, "N K"]:
    """ε = W χ."""
    return window.W[..., 0] + window.W[..., 1:] @ values


def residual_sd(windows: Sequence[Sampled], values: Nine) -> float:
    """σ_ρ: standard deviation of an equation's error, unbiased for nine parameters, in the unit of the equations."""
    total = sum(float((residual(w, values) ** 2).sum()) for w in windows)
    return float(np.sqrt(total / max(sum(w.rows for w in windows) - 9, 1)))


def evened(windows: Sequence[Sampled]) -> tuple[Sampled, ...]:
    """Weighted least squares: every window divided by the rms of its own least-squares residual.

    The weights come from least squares on X whatever Z is, so that they do not depend on the instruments.
    """
    weights = np.ones(len(windows))
    for _ in range(EVENING):
        weighted = [Sampled.plain(f * w.W, w.rank) for f, w in zip(weights, windows, strict=True)]
        values = solve(np.concatenate([stacked(w) for w in weighted]), sum(w.rows for w in windows))
        sizes = np.array([np.sqrt(np.mean(residual(w, values) ** 2)) for w in windows])
        weights = np.median(sizes) / np.maximum(sizes, 1e-6 * np.median(sizes) + 1e-300)
    return tuple(w.scaled(float(f)) for f, w in zip(weights, windows, strict=True))


def hausman(windows: Sequence[Sampled]) -> Hausman:
    """Regress y on X and on V = X − (its projection on Z); where X is exogenous the coefficients of V are zero.

    A Wald test with a Newey–West covariance, hence asymptotic. Raises RefusedError as `fit`.
    """
    Z = np.concatenate([w.Z.reshape(-1, 9) for w in windows])
    X = np.concatenate([w.W[..., 1:].reshape(-1, 9) for w in windows])
    project = np.linalg.lstsq(Z / np.linalg.norm(Z, axis=0), X, rcond=None)[0] / np.linalg.norm(Z, axis=0)[:, None]
    augmented = [np.concatenate([w.W[..., 1:], w.W[..., 1:] - w.Z @ project], axis=2) for w in windows]
    sizes = np.linalg.norm(np.concatenate([a.reshape(-1, 18) for a in augmented]), axis=0)
    augmented = [a / np.where(sizes > 0, sizes, 1.0) for a in augmented]
    A = np.concatenate([a.reshape(-1, 18) for a in augmented])
    y = np.concatenate([-w.W[..., 0].ravel() for w in windows])
    coefficients = np.linalg.lstsq(A, y, rcond=None)[0]
    scores = [
        np.einsum("nkj,nk->nj", a, -w.W[..., 0] - a @ coefficients) for a, w in zip(augmented, windows, strict=True)
    ]
    bread = np.linalg.pinv(A.T @ A)
    C = (bread @ _newey_west(scores) @ bread)[9:, 9:]
    gamma = coefficients[9:]
    dof = int(np.linalg.matrix_rank(C, hermitian=True))
    statistic = float(gamma @ np.linalg.pinv(C, hermitian=True) @ gamma)
    plain, instruments = fit([Sampled.plain(w.W, w.rank) for w in windows]), fit(windows)
    shifts = np.abs(plain.values - instruments.values) / instruments.sd
    most = int(np.argmax(shifts))
    p = float(chdtrc(dof, statistic))
    return Hausman(statistic, dof, p, float(shifts[most]), PARAMETER_NAMES[most])


def strength(windows: Sequence[Sampled]) -> float:
    """Smallest canonical correlation between X and Z, 0…1: near 1 the instruments are as good as the regressor."""
    X = np.linalg.qr(np.concatenate([w.W[..., 1:].reshape(-1, 9) for w in windows])).Q
    Z = np.linalg.qr(np.concatenate([w.Z.reshape(-1, 9) for w in windows])).Q
    return float(np.linalg.svd(X.T @ Z, compute_uv=False)[-1])


def _covariance(windows: Sequence[Sampled], values: Nine, kept: np.ndarray) -> Square:
    """(ZᵀX)⁻¹ S (ZᵀX)⁻ᵀ with S the Newey–West covariance of Zᵀε."""
    scores = [np.einsum("nkj,nk->nj", w.Z[..., kept], residual(w, values)) for w in windows]
    cross = sum((np.einsum("nki,nkj->ij", w.Z[..., kept], w.W[..., 1:][..., kept]) for w in windows), 0.0)
    bread = np.linalg.inv(cross)
    count = sum(w.rows for w in windows)
    out = np.zeros((9, 9))
    out[np.ix_(kept, kept)] = bread @ _newey_west(scores) @ bread.T * count / max(count - kept.sum(), 1)
    return out


def _newey_west(scores: Sequence[np.ndarray]) -> np.ndarray:
    """Σ of the autocovariances of the scores (N, p) within each window, Bartlett's weights."""
    lags = int(4 * (sum(len(g) for g in scores) / 100) ** (2 / 9))
    total = np.zeros((scores[0].shape[1],) * 2)
    for g in scores:
        total += g.T @ g
        for lag in range(1, min(lags, len(g) - 1) + 1):
            shifted = g[lag:].T @ g[:-lag]
            total += (1 - lag / (lags + 1)) * (shifted + shifted.T)
    return total


def _refuse_unexcited(X: np.ndarray, kept: np.ndarray) -> None:
    sizes = np.linalg.norm(X, axis=0)
    _, s, Vt = np.linalg.svd(X / np.where(sizes > 0, sizes, 1.0), full_matrices=False)
    if len(s) == X.shape[1] and s[-1] > RANK_TOLERANCE * s[0]:
        return
    names = [name for name, keep in zip(PARAMETER_NAMES, kept, strict=True) if keep]
    open_ = [names[k] for k in np.argsort(-np.abs(Vt[-1])) if abs(Vt[-1, k]) > 0.1]
    raise RefusedError(
        f"The motion does not excite every parameter: {', '.join(open_)} cannot be found from it.",
        hint="Record windows at other equilibria, with other displacements.",
    )
