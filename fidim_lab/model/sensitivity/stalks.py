"""Markers on stalks along given motions: a damped oscillator whose foot moves, node by node of a grid, exactly.

    ÿ + 2 ζ ω ẏ + ω² y = ω² f,    f = g − acceleration of the foot (world frame),    y = f where all is slow

Within a block f is the polynomial through its nodes: a polynomial solves the equation, and what is left of the state at
the block's begin dies as e^(−ζ ω t). So any stiffness costs the same.
"""

import numpy as np
from jaxtyping import Float
from numpy.polynomial import legendre
from scipy.linalg import expm

from fidim_lab.model.sensitivity.grid import Grid


def swung(
    felt: Float[np.ndarray, "N C"], grid: Grid, pulsation: float, damping: float, first: Float[np.ndarray, " C"]
) -> Float[np.ndarray, "N 3 C"]:
    """y, ẏ and ÿ at the nodes for f there, from rest at y = `first`; pulsation ω (rad/s), damping ratio ζ."""
    k, block = grid.resolution.intervals, grid.resolution.block
    t = grid.t[: k + 1]
    values = legendre.legvander(2 * t / block - 1, k)
    slopes = np.zeros((k + 1, k + 1))
    for power, one in enumerate(np.eye(k + 1)[1:], start=1):
        slopes[:power, power] = legendre.legder(one)[:power] * 2 / block
    lags = np.eye(k + 1) + 2 * damping / pulsation * slopes + slopes @ slopes / pulsation**2
    smooth = np.linalg.solve(lags, np.linalg.inv(values))
    by_nodes = np.stack([values @ smooth, values @ slopes @ smooth], axis=1)  # (k + 1, 2, k + 1)
    rates = np.array([[0.0, 1.0], [-(pulsation**2), -2 * damping * pulsation]])
    dying = expm(rates * t[:, np.newaxis, np.newaxis])
    found = np.empty((len(felt), 2, felt.shape[1]))
    found[0] = np.stack([first, np.zeros_like(first)])
    for begin in range(0, grid.blocks * k, k):
        inside = slice(begin, begin + k + 1)
        own = by_nodes @ felt[inside]
        found[inside] = own + dying @ (found[begin] - own[0])
    bend = pulsation**2 * (felt - found[:, 0]) - 2 * damping * pulsation * found[:, 1]
    return np.concatenate([found, bend[:, np.newaxis]], axis=1)


def swung_by(
    felt: Float[np.ndarray, "N C"], course: Float[np.ndarray, "N 3 C"], grid: Grid, pulsation: float, damping: float
) -> Float[np.ndarray, "2 N 3 C"]:
    """Derivatives of `swung`, whose `course` for f is given, by ω and ζ."""
    y, rate = course[:, 0], course[:, 1]
    nothing = np.zeros(felt.shape[1])
    driving = (2 * (felt - y) / pulsation - 2 * damping * rate / pulsation**2, -2 * rate / pulsation)
    return np.stack([swung(one, grid, pulsation, damping, nothing) for one in driving])
