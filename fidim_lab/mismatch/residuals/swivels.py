"""Readings of the swivels' encoders beside the angles that the pulleys have in a fitted motion.

Dry friction holds a swivel back until its cable, which then leaves the pulley's plane by δ, turns it: with the lever
b of the place where it leaves the pulley, its free length ρ and its horizontal distance H from the axis,

    torque = T δ b H / ρ ≤ 2 r T δ,

for b is at most 2 r and H at most ρ. A delay of the encoder, in proportion to the rate, is no friction.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Int

from fidim_lab.arrays import CableSeries
from fidim_lab.data.own_sensors import swivel_angles
from fidim_lab.data.records import Robot, Window
from fidim_lab.effects.wrenches import DRY_RATE
from fidim_lab.identification.mle.fit import Fit
from fidim_lab.mismatch.thresholds import SHARED
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.equations import BODY
from fidim_lab.model.sensitivity.sampling import sampled
from fidim_lab.model.statics import tensions


@dataclass(frozen=True, eq=False)
class SwivelCourse:
    """One window's."""

    robot: Robot
    window: Window
    rows: Int[np.ndarray, " T"]
    """of the window"""
    off: CableSeries
    """(T, n) rad, reading less angle, with an unknown zero of each cable; NaN where there is no reading"""
    rates: CableSeries
    """(T, n) rad/s of the angle"""
    curves: CableSeries
    """(T, n) rad/s²"""
    tensions: CableSeries
    """(T, n) N"""


def swivels(found: Fit) -> list[SwivelCourse]:
    """Of the windows that were fitted and have enough readings."""
    likelihood, simulation = found.likelihood, found.journey.optimum.simulation
    fitted = likelihood.mechanism
    mechanism = Mechanism(fitted.robot, fitted.effects, found.values[BODY:].tolist(), native=fitted.native)
    courses: list[SwivelCourse] = []
    for w, recording in enumerate(likelihood.recordings):
        window = recording.window
        read = swivel_angles(window, mechanism.n)
        if read is None:
            continue
        t = window.t - window.t[0] - recording.begin
        trajectories, place = simulation.trajectory_of(w)
        last = min(float(simulation.ends[w]), float(trajectories.grid.t[-1]))
        rows = np.flatnonzero((t >= 0) & (t <= last) & np.isfinite(read).any(axis=1))
        if len(rows) < SHARED.samples:
            continue
        motion = sampled(fitted, found.values, trajectories, place, t[rows])
        angles = np.unwrap(mechanism.swivel_angles(motion.positions, motion.rotations), axis=0)
        off = read[rows] - angles
        off -= 2 * np.pi * np.rint((off - np.nanmedian(off, axis=0)) / (2 * np.pi))
        held, _ = tensions(fitted, simulation.point.body, motion)
        rates = np.gradient(angles, t[rows], axis=0)
        curves = np.gradient(rates, t[rows], axis=0)
        courses.append(SwivelCourse(fitted.robot, window, rows, off, rates, curves, held * fitted.robot.mass))
    return courses


@dataclass(frozen=True)
class SwivelLag:
    """How far the swivels stay behind their cables whenever these turn back, beside a delay of their encoders."""

    angle: float
    """rad, mean over windows and cables"""
    sd: float
    """by their scatter"""
    most_torque: float
    """N m: dry friction beyond which they would stay behind by more, at `SHARED.certain` standard deviations"""


def lag(courses: Sequence[SwivelCourse]) -> SwivelLag | None:
    """Of all windows and cables; None where fewer than three of these are known."""
    angles: list[float] = []
    torques: list[float] = []
    for one in courses:
        radii = [cable.radius for cable in one.robot.cables]
        for k, radius in enumerate(radii):
            seen = np.isfinite(one.off[:, k])
            if seen.sum() < SHARED.samples:
                continue
            rate = one.rates[seen, k]
            columns = np.column_stack([np.tanh(rate / DRY_RATE), np.ones(len(rate)), rate, one.curves[seen, k]])
            behind = -float(np.linalg.lstsq(columns, one.off[seen, k], rcond=None)[0][0])
            angles.append(behind)
            torques.append(2 * radius * float(one.tensions[:, k].mean()) * behind)
    if len(angles) < SHARED.fewest:
        return None
    sds = np.std([angles, torques], axis=1, ddof=1) / np.sqrt(len(angles))
    most = abs(float(np.mean(torques))) + SHARED.certain * float(sds[1])
    return SwivelLag(float(np.mean(angles)), float(sds[0]), most)
