"""Total least squares as in the paper (Eq. 25–34), and the criterion C (Eq. 40).

`solve` is the paper's estimator on one stacked regressor W; `solve_essential` drops the parameters that do not matter
and solves again; `scaling_effect` shows what another column scaling would have answered, because total least squares
is not invariant to it. The paper scales no column, and neither does `solve`.

Everything needs W only through its QR factor: `compress` makes it, so that leaving windows out costs nothing.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from fidim_lab.data.records import PARAMETER_NAMES
from fidim_lab.errors import RefusedError

Regressor = Float[np.ndarray, "rows 10"]
"""W of Eq. 25: columns 1, s_x, s_y, s_z, I_xx, I_yy, I_zz, I_xy, I_xz, I_yz"""
Nine = Float[np.ndarray, "9"]

WELL_IDENTIFIED_PERCENT = 10.0
"""σ% (Eq. 34) above which a parameter is not well identified (§3.2)."""
NEAR_ZERO = 0.05
"""A parameter is near zero when it is below this share of the largest of its kind (s or I)."""


RANK_TOLERANCE = 1e-10
"""s_9 below this share of s_1: the regressor has lost a second direction."""
MASS_PART = 1e-6
"""of the smallest singular vector (norm 1), under which χ_1 = 1 cannot be reached"""


@dataclass(frozen=True, eq=False)
class TlsSolution:
    """What total least squares says about one regressor."""

    values: Nine
    """χ_2:10 (Eq. 30), 0 for a parameter that was left out; m, m²"""
    covariance: Float[np.ndarray, "9 9"]
    """C_χ (Eq. 32), 0 for a parameter that was left out"""
    sigma_W: float
    """σ_W (Eq. 31)"""
    C: float
    """(s_1 + 1)/s_9 (Eq. 40)"""
    singular_values: np.ndarray
    """of W, decreasing"""
    rows: int
    active: tuple[bool, ...]
    """which of the nine parameters were estimated"""

    @property
    def sd(self) -> Nine:
        """σ_χ (Eq. 33)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def chi(self) -> Float[np.ndarray, "10"]:
        """χ with its leading 1 (Eq. 22)."""
        return np.concatenate([[1.0], self.values])

    @property
    def percent(self) -> Nine:
        """σ% (Eq. 34); infinite where the parameter is exactly zero."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(self.values == 0, np.inf, 100 * self.sd / np.abs(self.values))


def compress(W: Regressor) -> Regressor:
    """The triangular factor of W = QR: has the singular values and right singular vectors of W, in at most ten rows."""
    return np.linalg.qr(W).R if W.shape[0] > W.shape[1] else W


def solve(W: Regressor, *, rows: int | None = None, active: np.ndarray | None = None) -> TlsSolution:
    """χ of W χ = 0 in the total-least-squares sense, normalised to χ_1 = 1 (Eq. 27–33).

    `rows` is λ n′_s of Eq. 31 when W is a compressed one. `active`, (9,) of bool, says which parameters are estimated
    (the columns of the others are removed, §3.2); σ_W then divides by rows − number of columns.
    Raises RefusedError when there are too few rows, a row is not a number, or the motion leaves a parameter open (a
    second singular value vanishes, or the last singular vector has no mass part so that nothing can be normalised).
    """
    kept = np.ones(9, dtype=bool) if active is None else np.asarray(active, dtype=bool)
    columns = np.flatnonzero(np.concatenate([[True], kept]))
    count = W.shape[0] if rows is None else rows
    if count <= len(columns):
        raise RefusedError(f"{count} equations for {len(columns)} unknowns: too few usable samples to identify a body.")
    if not np.isfinite(W).all():
        raise RefusedError(
            "The regressor has entries that are not numbers.", hint="Look at the samples that were used."
        )
    _, s, Vt = np.linalg.svd(W[:, columns], full_matrices=False)
    _refuse_unexcited(s, Vt, columns)
    chi = Vt[-1] / Vt[-1, 0]
    sigma_W = float(s[-1] / np.sqrt(count - len(columns)))
    values, covariance = np.zeros(9), np.zeros((9, 9))
    values[kept] = chi[1:]
    covariance[np.ix_(kept, kept)] = _covariance(s, Vt, chi, sigma_W)
    cost = float((s[0] + 1) / s[-2]) if s[-2] > 0 else np.inf
    return TlsSolution(values, covariance, sigma_W, cost, s, count, tuple(bool(k) for k in kept))


def _refuse_unexcited(s: np.ndarray, Vt: np.ndarray, columns: np.ndarray) -> None:
    """A second direction lost, or the only one without a mass part: say which parameters the motion leaves open."""
    lost = Vt[s <= RANK_TOLERANCE * s[0]] if s[-2] <= RANK_TOLERANCE * s[0] else Vt[-1:]
    if len(lost) == 1 and abs(lost[0, 0]) > MASS_PART:
        return
    names = ("1", *PARAMETER_NAMES)
    size = np.linalg.norm(lost, axis=0)
    free = [names[columns[i]] for i in np.argsort(-size) if size[i] > 0.1]
    raise RefusedError(
        f"The motion does not excite every parameter: {', '.join(free)} cannot be found from it.",
        hint="Record windows at other equilibria, with other displacements.",
    )


def _covariance(s: np.ndarray, Vt: np.ndarray, chi: np.ndarray, sigma_W: float) -> np.ndarray:
    """Eq. 32 with Ŵ of Eq. 29: ŴᵀŴ has the singular values of W but for the last, which is 0."""
    gram = (Vt[:-1].T * s[:-1] ** 2) @ Vt[:-1]
    return sigma_W**2 * (1 + chi[1:] @ chi[1:]) * np.linalg.inv(gram[1:, 1:])


def non_essential(solution: TlsSolution) -> np.ndarray:
    """Which of the nine are non-essential (§3.2), (9,) of bool: σ% over 10 *and* near zero.

    Near zero: below 5 % of the largest parameter of the same kind (s or I). A large σ% on a parameter that is not near
    zero is no reason to drop it but a sign that the experiment went wrong.
    """
    return (solution.percent > WELL_IDENTIFIED_PERCENT) & near_zero(solution.values) & np.array(solution.active)


def near_zero(values: Nine) -> np.ndarray:
    """Which of the nine are below 5 % of the largest of their kind, (9,) of bool."""
    size = np.abs(values)
    largest = np.concatenate([np.full(3, size[:3].max()), np.full(6, size[3:].max())])
    return size < NEAR_ZERO * largest


def doubtful(solution: TlsSolution) -> tuple[str, ...]:
    """Names of parameters with σ% over 10 that are *not* near zero: something went wrong there (§3.2)."""
    marks = (solution.percent > WELL_IDENTIFIED_PERCENT) & ~non_essential(solution) & np.array(solution.active)
    return tuple(name for name, mark in zip(PARAMETER_NAMES, marks, strict=True) if mark)


def solve_essential(W: Regressor, full: TlsSolution, *, rows: int | None = None) -> TlsSolution | None:
    """The solution without the non-essential parameters of `full`; None when all are essential."""
    drop = non_essential(full)
    if not drop.any():
        return None
    return solve(W, rows=rows, active=~drop)


def scaling_effect(W: Regressor, *, rows: int | None = None) -> Nine:
    """How far each parameter moves when every column of W is first scaled to norm 1 (equilibration), m and m².

    The paper scales nothing, and total least squares answers differently for every scaling. The difference,
    equilibrated − unscaled, is a lower bound of what the choice alone is worth.
    """
    norms = np.linalg.norm(W, axis=0)
    norms = np.where(norms > 0, norms, 1.0)
    _, _, Vt = np.linalg.svd(W / norms, full_matrices=False)
    chi = Vt[-1] / norms
    return chi[1:] / chi[0] - solve(W, rows=rows).values
