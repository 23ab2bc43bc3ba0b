"""Motor currents beside the tensions of a fitted motion: i = a + b τ, with a and b of each window and cable."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy.interpolate import CubicSpline

from fidim_lab.identification.mle.fit import Fit
from fidim_lab.mismatch.thresholds import SHARED


@dataclass(frozen=True, eq=False)
class CurrentCourse:
    """One motor's current beside the tension that the model has at the markers' stamps."""

    cable: int
    """from 0"""
    rows: Int[np.ndarray, " T"]
    """of the window"""
    t: Float[np.ndarray, " T"]
    """s since the fitted motion begins"""
    current: Float[np.ndarray, " T"]
    """A"""
    tension: CubicSpline
    """of t, per unit mass"""

    def misfit(self, offset: float) -> float:
        """Sum of squares with the best a and b, over that without a tension."""
        column = _centred(self.tension(self.t - offset))
        current = _centred(self.current)
        return 1.0 - float(column @ current) ** 2 / float(column @ column) / float(current @ current)

    def step(self, offset: float, rate: float) -> tuple[Float[np.ndarray, "2"], Float[np.ndarray, "2 2"]]:
        """Corrections of offset (s) and rate by this time course alone, with their weights (information)."""
        there = self.t - offset + rate * self.t
        slope = self.tension(there, 1)
        ours = np.column_stack([np.ones(len(there)), self.tension(there)])
        theirs = np.column_stack([-slope, self.t * slope])
        free, *_ = np.linalg.lstsq(ours, np.column_stack([theirs, self.current]), rcond=None)
        rest = np.column_stack([theirs, self.current]) - ours @ free
        normal = rest[:, :2].T @ rest[:, :2]
        shift = np.linalg.lstsq(normal, rest[:, :2].T @ rest[:, 2], rcond=1e-9)[0]
        left = rest[:, 2] - rest[:, :2] @ shift
        noise = float(left @ left) / (len(there) - 4)
        scale = float((free[:, 2] - free[:, :2] @ shift)[1])
        return shift / scale, scale**2 * normal / noise


def courses(found: Fit, w: int, margin: float = 0.0) -> list[CurrentCourse]:
    """Of the motors of window `w` whose current changes, less `margin` s at both ends of the fitted motion."""
    recording = found.likelihood.recordings[w]
    window = recording.window
    if window.currents is None:
        return []
    simulation = found.journey.optimum.simulation
    trajectories, place = simulation.trajectory_of(w)
    nodes = trajectories.grid.t
    t = window.t - window.t[0] - recording.begin
    inside = (t > margin) & (t < min(float(simulation.ends[w]), nodes[-1]) - margin)
    usable: list[CurrentCourse] = []
    for k in range(window.currents.shape[1]):
        current, tension = window.currents[:, k], trajectories.tensions[place, :, k]
        rows = np.flatnonzero(inside & np.isfinite(current))
        if len(rows) >= SHARED.samples and np.isfinite(tension).all() and np.ptp(current[rows]) > 0:
            usable.append(CurrentCourse(k, rows, t[rows], current[rows], CubicSpline(nodes, tension)))
    return usable


def _centred(values: np.ndarray) -> np.ndarray:
    return values - values.mean()
