"""Tension from motor current: gain, offset and friction band, from rests with known tensions.

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

from fidim_lab.arrays import PerCable
from fidim_lab.data.records import Body, Robot, Window
from fidim_lab.errors import RefusedError
from fidim_lab.model.equilibria import pose_from_lengths
from fidim_lab.model.mechanism import Mechanism

FEWEST = 5
"""rests: three unknowns of a winch, and something to judge them by"""
BY_DIRECTION = 4
"""rests after winding, and after paying out, that tell what of friction grows with the load"""
SIGNIFICANT = 3.0
"""standard deviations that it must be beyond nothing to be believed"""
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
    """T = gain · I + offset, within ± friction; with the direction D of the last move known (+1 paid out, −1 wound)

    T = (gain · I + offset + D · directed) / (1 − D · load_friction), within ± scatter.
    """

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
    directed: float = 0.0
    """N, the part of friction that changes sign with the last move"""
    load_friction: float = 0.0
    """the part that grows with the load: another efficiency of the gear in each direction"""
    scatter: float = np.inf
    """N, half the band that is left with the direction known; of the fit's own error, further than friction"""
    problem: str = ""
    """why it must not be used; empty where it may"""


def rests_of(robot: Robot, body: Body, windows: Sequence[Window]) -> Rests:
    """The mean currents of windows against the tensions of their rest by mean lengths; windows in order of visit.

    The mean over a swing is not the rest's: by several N at usual displacements, which widens the band (see
    `rests_of_readings`). Raises RefusedError where
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


@dataclass(frozen=True, eq=False)
class TensionReading:
    """One rest at which tensions were checked."""

    lengths: PerCable
    """m"""
    currents: PerCable
    """A"""
    moved: PerCable
    """+1 where the winch last paid out, −1 where it wound, 0 where that is unknown"""
    load_cells: PerCable | None = None
    """N, where every cable has one"""


def rests_of_readings(robot: Robot, body: Body, readings: Sequence[TensionReading]) -> Rests:
    """Tension checks at rest, against load cells where there are some, else against statics.

    Better than windows: a swing's mean tension is not that of the rest (12 N of 80 at 30 mm in the paper's robot).
    Raises RefusedError for too few, InfeasibleError where lengths are those of no rest.
    """
    if len(readings) < FEWEST:
        raise RefusedError(
            f"{len(readings)} tension checks at rest; {FEWEST} are needed.",
            hint="Run the procedure tension-check on more poses, with tensions as different as the workspace allows.",
        )
    mechanism = Mechanism(robot)
    tensions = [
        pose_from_lengths(mechanism, body, reading.lengths).tensions_in_newton(robot.mass)
        if reading.load_cells is None
        else reading.load_cells
        for reading in readings
    ]
    return Rests(
        np.array(tensions), np.array([r.currents for r in readings]), np.array([r.moved for r in readings], dtype=float)
    )


def calibrate(rests: Rests) -> tuple[WinchCalibration, ...]:
    """One calibration for each winch; where the rests do not determine it, `problem` says why."""
    columns = range(rests.tensions.shape[1])
    return tuple(_one(rests.tensions[:, k], rests.currents[:, k], rests.directions[:, k]) for k in columns)


def _one(
    tension: Float[np.ndarray, " K"], current: Float[np.ndarray, " K"], direction: Float[np.ndarray, " K"]
) -> WinchCalibration:
    design = _design(tension, current, direction)
    found, _, rank, _ = np.linalg.lstsq(design, current, rcond=1e-9)
    low, high = float(tension.min()), float(tension.max())
    slope = float(found[0])
    if rank < design.shape[1] or slope <= 0.0:
        problem = f"its current does not rise with its tension, which was {low:.0f} to {high:.0f} N"
        return WinchCalibration(np.nan, np.inf, np.nan, np.inf, np.inf, (low, high), len(tension), problem=problem)
    covariance, further = _spread(design, current, found)
    gain, offset = 1.0 / slope, -float(found[1]) / slope
    sd_gain = float(np.sqrt(covariance[0, 0])) / slope**2
    toward = np.array([-offset / slope, -1.0 / slope])  # of the offset −b/a, after a and b
    sd_offset = float(np.sqrt(toward @ covariance[:2, :2] @ toward))
    both = design.shape[1] > 2
    directed = -float(found[2]) / slope if both else 0.0
    load_friction = -float(found[3]) / slope if design.shape[1] > 3 else 0.0
    scatter = further / slope / (1.0 - abs(load_friction))
    if directed < 0.0:  # friction that pushes is chance
        directed, scatter = 0.0, scatter - directed
    friction = directed + abs(load_friction) * high + scatter
    problem = ""
    if sd_gain > WELL_KNOWN * gain:
        problem = (
            f"its gain is known to ± {sd_gain / gain:.0%} only: tensions of {low:.0f} to {high:.0f} N differ too little"
        )
    known = (directed, load_friction, scatter) if both else (0.0, 0.0, np.inf)
    return WinchCalibration(gain, sd_gain, offset, sd_offset, friction, (low, high), len(tension), *known, problem)


def _design(
    tension: Float[np.ndarray, " K"], current: Float[np.ndarray, " K"], direction: Float[np.ndarray, " K"]
) -> Float[np.ndarray, "K P"]:
    """Columns T, 1; D where both directions are there; D · T where rests are enough and it is more than chance."""
    columns = [tension, np.ones_like(tension)]
    if not direction.max() > 0.0 > direction.min():
        return np.column_stack(columns)
    columns.append(direction)
    plain = np.column_stack(columns)
    whole = np.column_stack([*columns, direction * tension])
    enough = min((direction > 0).sum(), (direction < 0).sum()) >= BY_DIRECTION
    if not enough or np.linalg.matrix_rank(whole) < whole.shape[1]:
        return plain
    found = np.linalg.lstsq(whole, current, rcond=1e-9)[0]
    covariance, _ = _spread(whole, current, found)
    return whole if abs(found[3]) > SIGNIFICANT * float(np.sqrt(covariance[3, 3])) else plain


def _spread(
    design: Float[np.ndarray, "K P"], current: Float[np.ndarray, " K"], found: Float[np.ndarray, " P"]
) -> tuple[Float[np.ndarray, "P P"], float]:
    """Covariance of what was found, and half the band (A) that holds 19 of 20 rests that were not fitted."""
    left = current - design @ found
    freedoms = max(len(current) - design.shape[1], 1)
    scatter = float(np.sqrt(left @ left / freedoms))
    inverse = np.linalg.inv(design.T @ design)
    leverage = float(np.einsum("ki,ij,kj->k", design, inverse, design).max())
    further = float(student.ppf(0.975, freedoms)) * scatter * float(np.sqrt(1.0 + leverage))
    return scatter**2 * inverse, further
