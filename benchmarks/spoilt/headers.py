"""What headers get wrong: clocks, units, axes, frames, places of markers."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.spoilt.spoiling import Draw
from fidim_lab.data.records import Campaign, Window


def rate(campaign: Campaign, rng: Draw) -> Campaign:
    factor = 1 + rng.choice([-1, 1]) * 10 ** rng.uniform(-3.5, -2.3)
    return replace(campaign, windows=tuple(replace(w, t=np.round(factor * w.t, 6)) for w in campaign.windows))


def jitter(window: Window, rng: Draw) -> Window:
    late = rng.exponential(rng.uniform(1e-3, 6e-3), len(window.t))
    return replace(window, t=_arrived(window.t + late))


def bunched(window: Window, rng: Draw) -> Window:
    n = len(window.t)
    late = rng.exponential(rng.uniform(1e-3, 5e-3), n)
    hit = rng.random(n) < rng.uniform(0.02, 0.1)
    late[hit] += rng.uniform(0.02, 0.08, int(hit.sum()))
    return replace(window, t=_arrived(window.t + late))


def _arrived(t: np.ndarray) -> np.ndarray:
    """One after the other, a tenth of a millisecond (the file's last digit) apart at least."""
    ticks = np.rint(1e4 * t) - np.arange(len(t))
    return 1e-4 * (np.maximum.accumulate(ticks) + np.arange(len(t)))


def axes(campaign: Campaign, rng: Draw) -> Campaign:
    turns = [np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0.0]]), np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0.0]])]
    return _turned(campaign, turns[rng.integers(2)], np.zeros(3))


def frame(campaign: Campaign, rng: Draw) -> Campaign:
    turn = Rotation.from_rotvec([*rng.normal(0, 0.03, 2), rng.uniform(-np.pi, np.pi)]).as_matrix()
    return _turned(campaign, turn, rng.uniform(-1, 1, 3))


def _turned(campaign: Campaign, turn: np.ndarray, shift: np.ndarray) -> Campaign:
    windows = (replace(w, markers=w.markers @ turn.T + shift, equilibrium=None) for w in campaign.windows)
    return replace(campaign, windows=tuple(windows))


def marker_offset(campaign: Campaign, rng: Draw) -> Campaign:
    by = rng.normal(size=3)
    by *= rng.uniform(0.003, 0.08) / np.linalg.norm(by)
    return replace(campaign, robot=replace(campaign.robot, marker=campaign.robot.marker + by))


def milliseconds(window: Window, rng: Draw) -> Window:
    return replace(window, t=np.round(1e3 * window.t, 3))


def millimetres(window: Window, rng: Draw) -> Window:
    return replace(window, markers=1e3 * window.markers)
