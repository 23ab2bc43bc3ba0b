"""The whitened residual of one window, with its motion: the input of `whiteness` and `locate`.

`of_fit` makes it from a maximum-likelihood fit, `of_simulation` from one window of any simulation (a held-out one:
`of_simulation(likelihood, prediction.journey.optimum.simulation, 0, prediction.remainder)` with the likelihood that
`predict` used); by hand where residuals come from elsewhere.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from fidim_lab.arrays import CableSeries, Series
from fidim_lab.data.records import Motion
from fidim_lab.identification.markers.clock_check import even_grid
from fidim_lab.identification.mle.fit import Fit
from fidim_lab.identification.mle.judge import Remainder
from fidim_lab.identification.mle.trajectories.likelihood import Likelihood, Simulation
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.sampling import sampled
from fidim_lab.model.statics import tensions


@dataclass(frozen=True, eq=False)
class Leftover:
    """The whitened residual of one window; one standard deviation of the noise is 1."""

    window: str
    t: Series
    """s on the window's own clock"""
    values: Float[np.ndarray, "T M 3"]
    """(recorded − predicted) / noise; NaN where nothing was recorded"""
    noise: float
    """m, standard deviation of a marker coordinate"""
    own: int
    """unknowns fitted to this window alone: pose and free twist, 6 + λ"""
    motion: Motion | None = None
    """as predicted, at `t`"""
    tensions: CableSeries | None = None
    """(T, n) as predicted, N"""
    swivel_rates: CableSeries | None = None
    """(T, n), rad/s"""
    evening: Float[np.ndarray, "M 3 3"] | None = None
    """by which the noise of each marker becomes even; None where it is"""
    directions: Float[np.ndarray, "T M 3 own"] | None = None
    """derivatives by the window's own unknowns: with them `whiteness` is exact, without it is conservative"""

    @property
    def chi2(self) -> float:
        """Sum of squares."""
        return float(np.nansum(self.values**2))

    @property
    def count(self) -> int:
        """Numbers that were recorded."""
        return int(np.isfinite(self.values).sum())

    def on_grid(self) -> tuple[float, Float[np.ndarray, "G K"]]:
        """Sample step (s) and values of even noise on the even grid of the sampling; NaN where there is none."""
        grid, values = even_grid(self.t), self.values
        if self.evening is not None:
            values = np.einsum("mij,tmj->tmi", self.evening, values)
        return grid.step, grid.spread(values.reshape(len(self.t), -1))


def of_fit(fit: Fit) -> tuple[Leftover, ...]:
    """All windows of a fit."""
    simulation = fit.journey.optimum.simulation
    return tuple(of_simulation(fit.likelihood, simulation, w, remainder) for w, remainder in enumerate(fit.remainders))


def of_remainders(fit: Fit) -> tuple[Leftover, ...]:
    """All windows of a fit by their residuals alone."""
    windows = zip(fit.likelihood.recordings, fit.remainders, strict=True)
    return tuple(of_remainder(recording.window.id, left, fit.likelihood) for recording, left in windows)


def of_remainder(window: str, left: Remainder, likelihood: Likelihood) -> Leftover:
    """One window or segment by its residual alone."""
    noise = likelihood.noise
    return Leftover(
        window=window, t=left.t, values=left.residuals / noise, noise=noise, own=likelihood.own, evening=left.evening
    )


def of_simulation(likelihood: Likelihood, simulation: Simulation, w: int, remainder: Remainder) -> Leftover:
    """Window `w` of a simulation with its remainder."""
    mechanism, shared = likelihood.mechanism, simulation.point.shared
    trajectories, place = simulation.trajectory_of(w)
    motion = sampled(mechanism, shared, trajectories, place, remainder.t - remainder.t[0])
    motion = Motion(remainder.t, motion.positions, motion.rotations, motion.twists, motion.accelerations)
    held, _ = tensions(mechanism, simulation.point.body, motion)
    return Leftover(
        window=likelihood.recordings[w].window.id,
        t=remainder.t,
        values=remainder.residuals / likelihood.noise,
        noise=likelihood.noise,
        own=likelihood.own,
        motion=motion,
        tensions=held * mechanism.robot.mass,
        swivel_rates=_swivel_rates(mechanism, motion),
        evening=remainder.evening,
    )


def _swivel_rates(mechanism: Mechanism, motion: Motion) -> CableSeries:
    angles = np.unwrap(mechanism.swivel_angles(motion.positions, motion.rotations), axis=0)
    return np.gradient(angles, motion.t, axis=0)
