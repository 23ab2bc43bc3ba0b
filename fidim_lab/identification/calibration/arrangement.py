"""The orientation of a recorded robot: every registration compared with the robot's own log.

A robot that looks the same from several sides is registered equally well from several sides; cable numbers then belong
to the wrong corners, and no length misfit shows it. Three signals of the log do: swivel angles (they decide), the sign
and gain of the stretch that load cells explain, and the inclinometer (they confirm). `judge` holds one registration
against the log, `choose` decides or refuses. The clock offset comes out on the way: it needs the right arrangement.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from fidim_lab.arrays import CableSeries, Positions, Rotations, Series
from fidim_lab.data.alignment import ClockOffset, align_clocks
from fidim_lab.data.importers.recording import RobotLog
from fidim_lab.errors import RefusedError
from fidim_lab.identification.calibration.registration import Registration, refine
from fidim_lab.model.mechanism import Mechanism

SURE = 0.8
"""correlation of the swivel angles that the right arrangement reaches"""
MARGIN = 0.1
"""by which it must beat the next"""


@dataclass(frozen=True, eq=False)
class ArrangementEvidence:
    """One arrangement and what the log says about it."""

    rigid: Registration
    """with cables that do not stretch"""
    stretched: Registration
    """with one compliance for all cables, from the load cells"""
    clock: ClockOffset
    """log against motion capture, by the swivel angles"""
    inclinometer: ClockOffset
    """the same by the inclinometer: another sensor, another delay"""
    load_cells: ClockOffset
    """the same by load cells against lengths: clock, filter delay and viscoelastic lag in one number"""

    @property
    def gain(self) -> float:
        """Share of the length misfit's power that a stretch explains."""
        return 1.0 - (self.stretched.rms / self.rigid.rms) ** 2


def judge(
    mechanism: Mechanism,
    registration: Registration,
    t: Series,
    positions: Positions,
    rotations: Rotations,
    log: RobotLog,
) -> ArrangementEvidence:
    """Hold one registration of cluster poses (N) against the robot's log.

    Raises RefusedError where motion capture and log cannot be aligned, InfeasibleError at a singular pose.
    """

    def clock_under(placing: Registration) -> ClockOffset:
        angles = _unwrapped(_where_known(mechanism.swivel_angles, *placing.poses(positions, rotations)))
        return align_clocks(t, angles, log.t, log.swivels)

    # The stretch needs the clock, and the clock is better once the stretch is known: rigid cables tilt the platform.
    tensions = at_times(t + clock_under(registration).offset, log.t, log.tensions)
    stretched = refine(mechanism, registration, positions, rotations, tensions)
    tensions = at_times(t + clock_under(stretched).offset, log.t, log.tensions)
    stretched = refine(mechanism, stretched, positions, rotations, tensions)
    placed = stretched.poses(positions, rotations)
    return ArrangementEvidence(
        rigid=refine(mechanism, registration, positions, rotations, tensions, stretch=False),
        stretched=stretched,
        clock=clock_under(stretched),
        inclinometer=align_clocks(t, _inclinations(placed[1]), log.t, log.inclinometer),
        load_cells=align_clocks(t, _where_known(mechanism.lengths, *placed), log.t, log.tensions),
    )


def choose(arrangements: Sequence[ArrangementEvidence]) -> ArrangementEvidence:
    """The arrangement whose swivel angles agree with the log's. Raises RefusedError where none, or two, agree."""
    ranked = sorted(arrangements, key=lambda evidence: -evidence.clock.correlation)
    best = ranked[0]
    if best.clock.correlation < SURE:
        raise RefusedError(
            f"No arrangement agrees with the log's swivel angles: the best correlates {best.clock.correlation:.2f}, "
            f"{SURE:g} is needed.",
            hint="Check that motion-capture export, robot log and geometry belong together.",
        )
    if len(ranked) > 1 and ranked[1].clock.correlation > best.clock.correlation - MARGIN:
        raise RefusedError(
            f"Two arrangements agree with the log's swivel angles: {best.clock.correlation:.2f} (yaw "
            f"{np.degrees(best.rigid.yaw):.0f}°) and {ranked[1].clock.correlation:.2f} "
            f"(yaw {np.degrees(ranked[1].rigid.yaw):.0f}°).",
            hint="Record a motion in which every cable swivels differently.",
        )
    return best


def at_times(wanted: Series, t: Series, values: np.ndarray) -> np.ndarray:
    """(K, k) signals at other times, linearly between samples; NaN outside."""
    return np.column_stack([np.interp(wanted, t, column, left=np.nan, right=np.nan) for column in values.T])


def _where_known(
    kinematics: Callable[[Positions, Rotations], CableSeries], positions: Positions, rotations: Rotations
) -> CableSeries:
    """Something of all cables at every pose; NaN where there is no pose."""
    known = np.all(np.isfinite(positions), axis=1)
    values = kinematics(positions[known], rotations[known])
    series = np.full((len(positions), values.shape[1]), np.nan)
    series[known] = values
    return series


def _unwrapped(angles: np.ndarray) -> np.ndarray:
    """Angles without jumps by 2π; NaN stays."""
    known = np.all(np.isfinite(angles), axis=1)
    smooth = angles.copy()
    smooth[known] = np.unwrap(angles[known], axis=0)
    return smooth


def _inclinations(rotations: Rotations) -> Positions:
    """Rotations about the world's x, y, z in this order, rad."""
    known = np.all(np.isfinite(rotations), axis=(1, 2))
    angles = np.full((len(rotations), 3), np.nan)
    angles[known] = Rotation.from_matrix(rotations[known]).as_euler("xyz")
    return _unwrapped(angles)
