"""What a motor current says of its cable's tension: gain, offset, friction band, from rests with known tensions.

At rest with locked motors the statics give every tension from the cable lengths (Eq. 8). Against them, for one winch,

    I = (T − offset ∓ friction) / gain

where the sign is that of the winch's last move: paying out, friction carries a part of the load; winding, it adds to
it. The current is fitted on the tension and not the other way round: the noise is in the current.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.stats import t as student

from fidim_lab.data.records import Body, Robot, Window
from fidim_lab.errors import RefusedError
from fidim_lab.model.equilibria import pose_from_lengths
from fidim_lab.model.mechanism import Mechanism

FEWEST = 5
"""rests: three unknowns of a winch, and something to judge them by"""
MOVED = 2e-3
"""m; a shorter move between two rests tells no direction of friction"""
WELL_KNOWN = 0.1
"""of the gain, one standard deviation, at most"""


@dataclass(frozen=True, eq=False)
class Rests:
    """K rests of a robot with n winches, in the order in which they were visited."""

    tensions: Float[np.ndarray, "K n"]
    """N, by statics"""
    currents: Float[np.ndarray, "K n"]
    """A, mean"""
    directions: Float[np.ndarray, "K n"]
    """+1 where the winch last paid out, −1 where it wound, 0 where that is unknown"""


@dataclass(frozen=True)
class WinchCalibration:
    """T = gain · I + offset, within ± friction."""

    gain: float
    """N/A"""
    sd_gain: float
    offset: float
    """N"""
    sd_offset: float
    friction: float
    """N, half the band that holds 19 of 20 further rests: by direction, scatter and the fit's own error"""
    range: tuple[float, float]
    """N, tensions that it rests on"""
    rests: int
    problem: str = ""
    """why it must not be used; empty where it may"""

    def certainly(self, current: float) -> tuple[float, float]:
        """The least and the largest tension (N) that a motor current (A) leaves possible."""
        tension = self.gain * current + self.offset
        return tension - self.friction, tension + self.friction


def rests_of(robot: Robot, body: Body, windows: Sequence[Window]) -> Rests:
    """The mean currents of windows against the tensions of their rest by mean lengths; windows in order of visit.

    The mean over a swing differs from the rest by the square of its angle: 0.5 % at 0.1 rad. Raises RefusedError where
    windows lack currents or lengths, InfeasibleError where lengths are those of no rest.
    """
    usable = [(w.lengths, w.currents) for w in windows if w.lengths is not None and w.currents is not None]
    if len(usable) < FEWEST:
        raise RefusedError(
            f"{len(usable)} of {len(windows)} windows have lengths and currents; {FEWEST} rests are needed.",
            hint="Record more poses, with tensions as different as the workspace allows.",
        )
    mechanism = Mechanism(robot)
    lengths = np.array([np.nanmean(series, axis=0) for series, _ in usable])
    currents = np.array([np.nanmean(series, axis=0) for _, series in usable])
    tensions = np.array([pose_from_lengths(mechanism, body, row).tensions_in_newton(robot.mass) for row in lengths])
    moves = np.diff(lengths, axis=0, prepend=lengths[:1])
    return Rests(tensions, currents, np.where(np.abs(moves) > MOVED, np.sign(moves), 0.0))


def calibrate(rests: Rests) -> tuple[WinchCalibration, ...]:
    """One calibration for each winch; one that the rests do not tell has its `problem`."""
    columns = range(rests.tensions.shape[1])
    return tuple(_one(rests.tensions[:, k], rests.currents[:, k], rests.directions[:, k]) for k in columns)


def _one(
    tension: Float[np.ndarray, " K"], current: Float[np.ndarray, " K"], direction: Float[np.ndarray, " K"]
) -> WinchCalibration:
    columns = [tension, np.ones_like(tension)]
    both = direction.max() > 0.0 > direction.min()
    if both:
        columns.append(direction)
    design = np.column_stack(columns)
    found, _, rank, _ = np.linalg.lstsq(design, current, rcond=1e-9)
    low, high = float(tension.min()), float(tension.max())
    slope = float(found[0])
    if rank < design.shape[1] or slope <= 0.0:
        problem = f"its current does not rise with its tension, which was {low:.0f} to {high:.0f} N"
        return WinchCalibration(np.nan, np.inf, np.nan, np.inf, np.inf, (low, high), len(tension), problem)
    left = current - design @ found
    freedoms = max(len(tension) - design.shape[1], 1)
    scatter = float(np.sqrt(left @ left / freedoms))
    inverse = np.linalg.inv(design.T @ design)
    covariance = scatter**2 * inverse
    gain, offset = 1.0 / slope, -float(found[1]) / slope
    sd_gain = float(np.sqrt(covariance[0, 0])) / slope**2
    toward = np.array([-offset / slope, -1.0 / slope])  # of the offset −b/a, after a and b
    sd_offset = float(np.sqrt(toward @ covariance[:2, :2] @ toward))
    leverage = float(np.einsum("ki,ij,kj->k", design, inverse, design).max())
    further = float(student.ppf(0.975, freedoms)) * scatter * np.sqrt(1.0 + leverage)  # a rest that was not fitted
    friction = (abs(float(found[2])) if both else 0.0) + further
    problem = ""
    if sd_gain > WELL_KNOWN * gain:
        problem = (
            f"its gain is known to ± {sd_gain / gain:.0%} only: tensions from {low:.0f} to {high:.0f} N tell too little"
        )
    return WinchCalibration(gain, sd_gain, offset, sd_offset, friction / slope, (low, high), len(tension), problem)
