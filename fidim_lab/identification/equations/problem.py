"""The identification problem: every usable window as equations W χ = 0 (Eq. 20–25), ready for any estimator.

`build` turns a campaign into a `Problem`; `WindowEquations.rows(body)` gives one window's regressor. `body` only
weights the equations (`BalanceRows.MARKER`); the paper's rows ignore it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from fidim_lab.arrays import Series
from fidim_lab.data.records import Body, Campaign, Role, Window
from fidim_lab.errors import FidimError, RefusedError
from fidim_lab.identification.equations.refusals import together
from fidim_lab.identification.motion.filters import FilterDesign, Kernels, convolve, design
from fidim_lab.identification.motion.measured import MORE_MARKERS, MeasuredMotion, measure
from fidim_lab.identification.motion.recipe import BalanceRows, Recipe
from fidim_lab.identification.motion.surface import free_directions
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion import free_twist_basis, marker_selector
from fidim_lab.model.regressor import platform_regressor

Regressor = Float[np.ndarray, "N K 10"]
"""K equations for every sample, of rank λ"""


@dataclass(frozen=True, eq=False)
class WindowEquations:
    """One window's motion with everything that turns it into equations."""

    measured: MeasuredMotion
    platform: Float[np.ndarray, "N 6 10"]
    """W_EE (Eq. 19)"""
    directions: Float[np.ndarray, "N 6 free"]
    """basis of the free twists: of the free coordinates (Eq. 6), or any for `BalanceRows.MARKER`"""
    recipe: Recipe
    noise: float
    """standard deviation of a marker coordinate, m"""

    @property
    def window(self) -> Window:
        """The recording."""
        return self.measured.window

    @property
    def freedoms(self) -> int:
        """λ: how many of the K equations of a sample are independent."""
        return self.directions.shape[2]

    def rows(self, body: Body) -> Regressor:
        """W of this window at every usable sample, after the equation filter if there is one (not decimated)."""
        if self.recipe.rows is BalanceRows.FREE_COORDINATES:
            return self._filtered(np.swapaxes(self.directions, 1, 2) @ self.platform)
        return self._filtered(self._marker_projection(body) @ self.platform)

    @property
    def times(self) -> Series:
        """The time of every row of `rows`, s."""
        t = self.measured.motion.t
        return np.concatenate([t[begin + trim : end - trim] for begin, end, trim in self._stretches()])

    @property
    def noise_floor(self) -> float | None:
        """Standard deviation that marker noise alone gives to an equation, m/s²; None for rows without that unit.

        White noise of the robot file's size through second differentiation and the equation filter.
        """
        if self.recipe.rows is not BalanceRows.MARKER:
            return None
        duration = float(self.window.t[-1] - self.window.t[0])
        taps = design(self.recipe.signals, self.measured.rate, duration).second
        if self.recipe.equations is not None:
            taps = np.convolve(taps, self._kernels(self.recipe.equations).value)
        return self.noise * float(np.linalg.norm(taps))

    def decimated(self, body: Body) -> Regressor:
        """`rows`, thinned to the recipe's samples per window and to no more than the filter leaves independent.

        Below a stop band of f there are 2 f independent samples a second; more would only make the standard
        deviations of Eq. 31–32 look smaller than they are.
        """
        W = self.rows(body)
        return W[self.picked(len(W))]

    def picked(self, rows: int) -> np.ndarray:
        """Which of so many neighbouring rows `decimated` keeps, as indices."""
        count = rows if self.recipe.samples is None else min(rows, self.recipe.samples)
        if self.recipe.equations is not None and self.recipe.samples is not None:
            independent = 2 * self.recipe.equations.stop_band * rows / self.measured.rate
            count = min(count, max(2, round(independent)))
        return np.rint(np.linspace(0, rows - 1, count)).astype(int)

    def _marker_projection(self, body: Body) -> np.ndarray:
        """(N, K, 6): B (BᵀB)⁻¹ Ξ⊥ᵀ, the wrench as the least change of marker accelerations that would balance it.

        For tied motion accelerations change by J Ξ⊥ q̈, so B (BᵀB)⁻¹ = J Ξ⊥ (Ξ⊥ᵀ M Ξ⊥)⁻¹; for a full pose all six
        change, and B = J (JᵀJ)⁻¹ M Ξ⊥. Neither depends on the basis of Ξ⊥, so rows are continuous in time.
        """
        N, J = self.directions, self.measured.jacobian
        M = mass_matrices(body, self.measured.motion.rotations)
        if self.measured.tied:
            return J @ N @ np.linalg.solve(np.swapaxes(N, 1, 2) @ M @ N, np.swapaxes(N, 1, 2))
        if J.shape[1] > 6:  # K rows of rank 6: the Cholesky factor of JᵀJ says the same in six
            return _least_change(np.swapaxes(np.linalg.cholesky(np.swapaxes(J, 1, 2) @ J), 1, 2), M, N)
        return _least_change(J, M, N)

    def _filtered(self, W: Regressor) -> Regressor:
        if self.recipe.equations is None:
            return W
        taps = self._kernels(self.recipe.equations).value
        return np.concatenate([convolve(taps, W[begin:end]) for begin, end, _ in self._stretches()])

    def _kernels(self, spec: FilterDesign) -> Kernels:
        samples = self.measured.samples
        return design(spec, self.measured.rate, (samples[-1] - samples[0]) / self.measured.rate)

    def _stretches(self) -> list[tuple[int, int, int]]:
        """Begin and end of every run of neighbouring samples that is used, and what the filter takes at each end."""
        samples = self.measured.samples
        if self.recipe.equations is None:
            return [(0, len(samples), 0)]
        half = self._kernels(self.recipe.equations).half
        follows = np.concatenate([[True], np.diff(samples) == 1])
        runs = _runs_of_neighbours(follows)
        found = [(begin, end, half) for begin, end in runs if end - begin > 2 * half]
        if not found:
            raise self._too_short(2 * half, max(end - begin for begin, end in runs))
        return found

    def _too_short(self, needed: int, longest: int) -> RefusedError:
        """That no stretch holds the filter, with what has broken them up; both lengths in samples."""
        rate, why = self.measured.rate, "; ".join(self.measured.broken_by) or "the window is too short"
        return RefusedError(
            f"Window {self.window.id}: the equations of motion need more than {needed / rate:.2f} s without a break, "
            f"the longest stretch has {longest / rate:.2f} s: {why}.",
            hint=MORE_MARKERS if self.measured.broken_by else "",
        )


def _least_change(J: np.ndarray, M: np.ndarray, N: np.ndarray) -> np.ndarray:
    """B (BᵀB)⁻¹ Nᵀ with B = J (JᵀJ)⁻¹ M N."""
    B = J @ np.linalg.solve(np.swapaxes(J, 1, 2) @ J, M @ N)
    return B @ np.linalg.solve(np.swapaxes(B, 1, 2) @ B, np.swapaxes(N, 1, 2))


def _runs_of_neighbours(follows: np.ndarray) -> list[tuple[int, int]]:
    """Begin and end of every run of neighbouring samples; `follows[k]`: sample k is the next after k − 1."""
    begins = [0, *np.flatnonzero(~follows).tolist()]
    return list(zip(begins, [*begins[1:], len(follows)], strict=True))


def mass_matrices(body: Body, rotations: np.ndarray) -> Float[np.ndarray, "N 6 6"]:
    """M/m of Eq. 9 at every sample, world frame."""
    s = rotations @ body.com
    cross = np.zeros((len(s), 3, 3))
    cross[:, 0, 1], cross[:, 0, 2], cross[:, 1, 2] = -s[:, 2], s[:, 1], -s[:, 0]
    cross = cross - np.swapaxes(cross, 1, 2)
    M = np.zeros((len(s), 6, 6))
    M[:, :3, :3] = np.eye(3)
    M[:, :3, 3:], M[:, 3:, :3] = -cross, cross
    M[:, 3:, 3:] = rotations @ body.inertia_matrix @ np.swapaxes(rotations, 1, 2)
    return M


@dataclass(frozen=True, eq=False)
class UnusedWindow:
    """A window that gives no equations, with the reason."""

    window: Window
    reason: str


@dataclass(frozen=True, eq=False)
class Problem:
    """What an estimator gets: the campaign, its windows as equations, and what could not be used."""

    campaign: Campaign
    mechanism: Mechanism
    recipe: Recipe
    equations: tuple[WindowEquations, ...]
    unused: tuple[UnusedWindow, ...] = ()

    def of_role(self, role: Role) -> tuple[WindowEquations, ...]:
        """The windows of one role that can be used."""
        return tuple(e for e in self.equations if e.window.role is role)


def window_equations(mechanism: Mechanism, campaign: Campaign, window: Window, recipe: Recipe) -> WindowEquations:
    """The equations of one window. Raises as `measure`."""
    return motion_equations(mechanism, measure(mechanism, campaign, window, recipe), recipe)


def motion_equations(mechanism: Mechanism, measured: MeasuredMotion, recipe: Recipe) -> WindowEquations:
    """The equations of a motion that is known. Raises InfeasibleError at a singular pose."""
    motion, robot = measured.motion, mechanism.robot
    xi = mechanism.structure_matrix(motion.positions, motion.rotations)
    if recipe.rows is BalanceRows.FREE_COORDINATES:
        directions = free_twist_basis(xi, marker_selector(motion.rotations, robot.marker, measured.axes))
    else:
        directions = free_directions(xi)
    regressor = platform_regressor(motion, robot.gravity)
    return WindowEquations(measured, regressor, directions, recipe, robot.sensors.marker_noise)


def build(
    campaign: Campaign, recipe: Recipe, windows: Sequence[Window] | None = None, *, native: bool = False
) -> Problem:
    """Equations of all windows (or of those given). native: what is simulated of them is, with compiled C.

    A window that cannot be used is left out with its reason, in `unused`, and the others go on. Raises RefusedError
    when no `identify` window is left.
    """
    mechanism = Mechanism(campaign.robot, native=native)
    used: list[WindowEquations] = []
    unused: list[UnusedWindow] = []
    for window in campaign.windows if windows is None else windows:
        try:
            equations = window_equations(mechanism, campaign, window, recipe)
            equations.rows(campaign.robot.nominal)
            used.append(equations)
        except FidimError as error:
            unused.append(UnusedWindow(window, str(error)))
    if not any(e.window.role is Role.IDENTIFY for e in used):
        reasons = together({one.window.id: one.reason for one in unused}) or "the campaign has none."
        raise RefusedError(f"No window of role 'identify' can be used: {reasons}")
    return Problem(campaign, mechanism, recipe, tuple(used), tuple(unused))
