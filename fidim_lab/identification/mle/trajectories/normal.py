"""The normal equations of a trajectory fit, each window compressed to one small triangular factor.

The table of a window is R of QR [J_own J_shared r]: it holds everything that the data of the window say to first
order, in (own + shared + 1)² numbers. Own unknowns come first, so that striking out their rows and columns eliminates
them: `reduced`. Steps, covariance, bootstrap and jackknife all work on tables and cost next to nothing.

On the way, a prior keeps the search among bodies that can exist: the geodesic distance of pseudo-inertias.

    distance² = ‖log(J₀^-½ J J₀^-½)‖²    (Lee & Park 2018, A geometric algorithm for robust multibody inertial
                                           parameter identification; J as in `equations.consistency`)

It is the same in every frame and unit, grows without bound towards bodies that cannot exist, and near J₀ counts a
second moment by its ratio. Short recordings determine less than nine parameters: without it a search may run to where
the mass matrix is singular, and no step leads on from there.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.optimize import lsq_linear

from fidim_lab.data.records import Body
from fidim_lab.identification.equations.consistency import pseudo_inertia
from fidim_lab.identification.mle.trajectories.likelihood import Likelihood, Simulation, WindowLinear, of_each

FACTOR = 1.3
"""by which a second moment of the body may differ from its start: one standard deviation, on the way. Of 36 fits (2 to
4 cables, half of them from moments off by a factor of 2 and a centre of mass off by 30 mm) one fails; with 1.15 two,
with 1.5 five, with independent priors on the nine parameters five"""
EQUAL = 1e-6
"""of an eigenvalue: nearer ones count as equal, where a quotient of differences would be rounding alone"""

TINY = 1e-300
"""a range must not be empty"""
BLOCK = 400
"""rows of a block of a tall matrix: 27000 rows of 20, 40, 75 columns: 8.7, 30, 72 ms whole, 2.6, 11, 32 in blocks"""

Tables = Float[np.ndarray, "W m m"]
"""m = own + shared + 1"""
Reduced = Float[np.ndarray, "W s s"]
"""s = shared + 1"""


class NearBody:
    """The distance to one body that can exist, in standard deviations."""

    def __init__(self, body: Body) -> None:
        values, axes = np.linalg.eigh(pseudo_inertia(body))
        self._root = (axes / np.sqrt(values)) @ axes.T
        nothing = pseudo_inertia(Body.from_vector(np.zeros(9)))
        units = [pseudo_inertia(Body.from_vector(unit)) - nothing for unit in np.eye(9)]
        self._units = [self._root @ unit @ self._root for unit in units]

    def residual(self, vector: Float[np.ndarray, "9"]) -> Float[np.ndarray, "16"]:
        """Its square is the squared distance; infinite for a body that cannot exist."""
        values, axes = self._along(vector)
        if not values[0] > 0:
            return np.full(16, np.inf)
        return ((axes * np.log(values)) @ axes.T).ravel() / np.log(FACTOR)

    def rows(self, vector: Float[np.ndarray, "9"]) -> Float[np.ndarray, "16 10"]:
        """[J r] of the residual r at a body that can exist."""
        values, axes = self._along(vector)
        apart = np.subtract.outer(values, values)
        close = np.abs(apart) < EQUAL * values
        logs = np.log(values)
        # Daleckii and Krein: the derivative of a function of a matrix, in the matrix's own axes
        slopes = np.where(close, 1 / values, np.subtract.outer(logs, logs) / np.where(close, 1.0, apart))
        by_vector = [axes @ (slopes * (axes.T @ unit @ axes)) @ axes.T for unit in self._units]
        derivatives = np.column_stack([one.ravel() for one in by_vector]) / np.log(FACTOR)
        return np.column_stack([derivatives, self.residual(vector)])

    def _along(self, vector: Float[np.ndarray, "9"]) -> tuple[Float[np.ndarray, "4"], Float[np.ndarray, "4 4"]]:
        """Eigenvalues and axes of J₀^-½ J J₀^-½."""
        values, axes = np.linalg.eigh(self._root @ pseudo_inertia(Body.from_vector(vector)) @ self._root)
        return values, axes


@dataclass(frozen=True, eq=False)
class Prior:
    """What is known of the shared parameters beforehand: independent, normal."""

    mean: Float[np.ndarray, " shared"]
    sd: Float[np.ndarray, " shared"]
    """infinite where nothing is known"""
    low: Float[np.ndarray, " shared"] | None = None
    """hard bounds that no fit crosses; None: none"""
    high: Float[np.ndarray, " shared"] | None = None
    firm: int | None = None
    """entries from here on are meant as they are, those before only help to find the way; None: no entry is firm"""
    near: NearBody | None = None
    """in place of the entries before `firm`"""

    def loosened(self, factor: float) -> "Prior":
        """With standard deviations so many times as large, but for the firm ones."""
        if self.firm is None:
            return replace(self, sd=factor * self.sd)
        return replace(self, sd=np.concatenate([factor * self.sd[: self.firm], self.sd[self.firm :]]))

    def by_existing(self, near: NearBody) -> "Prior":
        """With the distance to a body in place of all entries that are not firm."""
        sd = self.sd.copy()
        sd[: self.firm] = np.inf
        return replace(self, sd=sd, near=near)

    def rows(self, shared: Float[np.ndarray, " shared"]) -> Float[np.ndarray, "rows s"]:
        """[J r] of the prior at a point."""
        rows = np.column_stack([np.diag(1 / self.sd), (shared - self.mean) / self.sd])
        if self.near is None:
            return rows
        of_body = self.near.rows(shared[: self.firm])
        wide = np.zeros((len(of_body), rows.shape[1]))
        wide[:, : self.firm], wide[:, -1] = of_body[:, :-1], of_body[:, -1]
        return np.vstack([rows, wide])

    @property
    def bounds(self) -> tuple[Float[np.ndarray, " shared"], Float[np.ndarray, " shared"]]:
        """Lowest and highest values, infinite where there is no bound."""
        none = np.full(len(self.mean), np.inf)
        return -none if self.low is None else self.low, none if self.high is None else self.high

    def room(self, shared: Float[np.ndarray, " shared"]) -> tuple[np.ndarray, np.ndarray] | None:
        """How far each parameter may go down (≤ 0) and up from here; None where nothing is bounded."""
        if self.low is None or self.high is None:
            return None
        return self.low - shared, self.high - shared

    def cost(self, shared: Float[np.ndarray, " shared"]) -> float:
        """Its part of the sum of squares."""
        independent = float((((shared - self.mean) / self.sd) ** 2).sum())
        if self.near is None:
            return independent
        return independent + float((self.near.residual(shared[: self.firm]) ** 2).sum())


@dataclass(frozen=True, eq=False)
class NormalStep:
    """A step of all unknowns and the sum of squares to which it would lead if all were linear."""

    own: Float[np.ndarray, "W own"]
    shared: Float[np.ndarray, " shared"]
    predicted: float


def tables_of(likelihood: Likelihood, simulation: Simulation, *, held: bool = False) -> Tables:
    """Of all windows, in their order; held: without columns of what is shared."""
    return np.stack(of_each(likelihood, simulation, compressed, held=held))


def compressed(window: WindowLinear) -> Float[np.ndarray, "m m"]:
    """The table of a window."""
    stacked = np.column_stack([window.by_own, window.by_shared, window.residual])
    missing = stacked.shape[1] - stacked.shape[0]
    if missing > 0:
        stacked = np.vstack([stacked, np.zeros((missing, stacked.shape[1]))])
    return _triangular(stacked)


def reduced(tables: Tables, own: int) -> Reduced:
    """[J_shared r] of each window with its own unknowns eliminated (chosen best for any shared parameters)."""
    return tables[:, own:, own:]


def step(
    tables: Tables,
    own: int,
    prior_rows: Float[np.ndarray, "rows s"],
    damping: float,
    free: Bool[np.ndarray, " shared"],
    room: tuple[np.ndarray, np.ndarray] | None = None,
) -> NormalStep:
    """A Gauss–Newton step with Marquardt's damping, relative to the columns' own size; held parameters do not move.

    room: as `Prior.room`; the step is the best one within it.
    """
    whole = Part(tables, own, np.arange(tables.shape[1] - own - 1))
    (steps,), shared, predicted = step_of_parts((whole,), prior_rows, damping, free, room)
    return NormalStep(own=steps, shared=shared, predicted=predicted)


@dataclass(frozen=True, eq=False)
class Part:
    """Windows of one kind in a fit that has several: their own unknowns are as many, they share the same parameters."""

    tables: Tables
    own: int
    place: Int[np.ndarray, " local"]
    """of their shared parameters among those of the whole fit"""

    def spread(self, rows: Float[np.ndarray, "*K s"], count: int) -> Float[np.ndarray, "*K S"]:
        """Rows [J_shared r] with a column for each of the whole fit's `count` parameters."""
        wide = np.zeros((*rows.shape[:-1], count + 1))
        wide[..., self.place], wide[..., -1] = rows[..., :-1], rows[..., -1]
        return wide


def step_of_parts(
    parts: Sequence[Part],
    prior_rows: Float[np.ndarray, "rows s"],
    damping: float,
    free: Bool[np.ndarray, " shared"],
    room: tuple[np.ndarray, np.ndarray] | None = None,
) -> tuple[list[Float[np.ndarray, "W own"]], Float[np.ndarray, " shared"], float]:
    """As `step`, of several parts: the steps of their own unknowns, the shared one, the sum of squares foretold."""
    weight, width = np.sqrt(damping), prior_rows.shape[1] - 1
    square = (prior_rows[:, :-1] ** 2).sum(axis=0)
    eliminated: list[Tables] = []
    for part in parts:
        tables, own = part.tables, part.own
        scales = np.linalg.norm(tables, axis=1)
        ridge = np.zeros((len(tables), own, tables.shape[2]))
        ridge[:, range(own), range(own)] = weight * scales[:, :own]
        eliminated.append(_triangular(np.concatenate([tables, ridge], axis=1)))
        np.add.at(square, part.place, (scales[:, own:-1] ** 2).sum(axis=0))
    shared_ridge = np.column_stack([np.diag(weight * np.sqrt(square)), np.zeros(width)])
    seen = [
        part.spread(reduced(damped, part.own), width).reshape(-1, width + 1)
        for part, damped in zip(parts, eliminated, strict=True)
    ]
    shared = _within(np.vstack([*seen, prior_rows, shared_ridge]), free, room)
    before = prior_rows @ np.append(shared, 1.0)
    steps, predicted = [], float(before @ before)
    for part, damped in zip(parts, eliminated, strict=True):
        own, local = part.own, shared[part.place]
        right = damped[:, :own, -1] + damped[:, :own, own:-1] @ local
        steps.append(np.linalg.solve(damped[:, :own, :own], -right[..., np.newaxis])[..., 0])
        ends = np.concatenate([steps[-1], np.tile(np.append(local, 1.0), (len(damped), 1))], axis=1)
        left = (part.tables @ ends[..., np.newaxis]).ravel()
        predicted += float(left @ left)
    return steps, shared, predicted


def own_steps(
    tables: Tables, own: int, damping: Float[np.ndarray, " W"]
) -> tuple[Float[np.ndarray, "W own"], Float[np.ndarray, " W"]]:
    """As `step`, of windows that share nothing, each with its own damping; the sum of squares foretold for each."""
    count, size = len(tables), tables.shape[1]
    scales = np.linalg.norm(tables, axis=1)
    ridge = np.zeros((count, own, size))
    ridge[:, range(own), range(own)] = np.sqrt(damping)[:, np.newaxis] * scales[:, :own]
    damped = _triangular(np.concatenate([tables, ridge], axis=1))
    steps = np.linalg.solve(damped[:, :own, :own], -damped[:, :own, -1:])[..., 0]
    left = (tables[:, :, :own] @ steps[..., np.newaxis])[..., 0] + tables[:, :, -1]
    return steps, (left**2).sum(axis=1)


def _within(
    rows: np.ndarray, free: Bool[np.ndarray, " shared"], room: tuple[np.ndarray, np.ndarray] | None
) -> Float[np.ndarray, " shared"]:
    """Least squares over the free parameters within their room."""
    shared = np.zeros(len(free))
    if not free.any():
        return shared
    inner, right = rows[:, :-1][:, free], -rows[:, -1]
    shared[free] = _least_squares(inner, right)
    if room is not None and ((shared < room[0]) | (shared > room[1])).any():
        scale = np.linalg.norm(inner, axis=0)
        scale = np.where(scale > 0, scale, 1.0)
        ends = (np.minimum(room[0][free], 0.0) * scale, np.maximum(room[1][free], TINY) * scale)
        found = lsq_linear(inner / scale, right, bounds=ends, method="bvls")
        shared[free] = np.clip(found.x / scale, room[0][free], room[1][free])
    return shared


def _triangular(matrices: np.ndarray) -> np.ndarray:
    """R of each matrix of a stack."""
    rows, columns = matrices.shape[-2:]
    blocks = rows // max(BLOCK, 4 * columns)
    if matrices.ndim == 2 and blocks > 1:  # a tall matrix does not fit the processor's cache, its blocks do
        size = rows // blocks
        parts = _triangular(matrices[: blocks * size].reshape(blocks, size, columns))
        matrices = np.vstack([parts.reshape(-1, columns), matrices[blocks * size :]])
    return np.asarray(np.linalg.qr(matrices, mode="r"))


def _least_squares(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Least squares with columns brought to one size first: the units are m, m² and whatever θ has."""
    scale = np.linalg.norm(matrix, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    return np.linalg.lstsq(matrix / scale, right, rcond=1e-12)[0] / scale
