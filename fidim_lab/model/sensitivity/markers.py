"""Where markers of the platform are, at any times between the nodes of a grid, with derivatives.

Position, velocity and acceleration at the nodes, and the quintic Hermite polynomial between them: the nodes lie at most
17 ms apart, so it is good to 1e-9 m for motions of a few hertz.

A marker on a stalk is a damped oscillator whose foot moves, followed exactly from node to node:

    ÿ + 2 ζ ω ẏ + ω² y = ω² f,    f = g − acceleration of the foot (world frame),    y = f where all is slow

Within a block f is the polynomial through its nodes: a polynomial solves the equation, and what is left of the state at
the block's begin dies as e^(−ζ ω t). So any stiffness costs the same.
"""

import numpy as np
from jaxtyping import Float, Int
from numpy.polynomial import legendre
from scipy.linalg import expm
from scipy.sparse import csr_array

from fidim_lab.arrays import Series, skew
from fidim_lab.model.sensitivity.grid import Grid
from fidim_lab.model.sensitivity.integrate import Trajectories
from fidim_lab.model.sensitivity.variation import Variations

WIDE = 30
"""columns, from which a sparse product is faster than copies of both ends"""

Nodal = Float[np.ndarray, "W N 3 M 3"]
"""marker position, velocity, acceleration at the nodes; markers; world x, y, z"""


def at_nodes(trajectories: Trajectories, markers: Float[np.ndarray, "M 3"]) -> Nodal:
    """Position (m), velocity and acceleration of markers (body frame, m) at every node."""
    arms = _arms(trajectories, markers)
    v, a = trajectories.twists[:, :, np.newaxis], trajectories.accelerations[:, :, np.newaxis]
    swept = np.cross(v[..., 3:], arms)
    return np.stack(
        [
            trajectories.positions[:, :, np.newaxis] + arms,
            v[..., :3] + swept,
            a[..., :3] + np.cross(a[..., 3:], arms) + np.cross(v[..., 3:], swept),
        ],
        axis=2,
    )


def varied_at_nodes(
    trajectories: Trajectories,
    by: Variations,
    markers: Float[np.ndarray, "M 3"],
    nodes: slice | Int[np.ndarray, " N"] = slice(None),
) -> Float[np.ndarray, "W N 3 M 3 P"]:
    """Derivatives of `at_nodes` by the P columns of the variations, at these nodes."""
    held = _arms(trajectories, markers)[:, nodes]
    arms, spin, spin_rate = (
        skew(x)
        for x in (
            held,
            trajectories.twists[:, nodes, np.newaxis, 3:],
            trajectories.accelerations[:, nodes, np.newaxis, 3:],
        )
    )
    one = np.broadcast_to(np.eye(3), arms.shape)
    # δ(R m) = δθ × R m with δθ = R δφ
    turned = -arms @ trajectories.rotations[:, nodes, np.newaxis]
    swept = skew((spin @ held[..., np.newaxis])[..., 0])
    windows, count, marked = arms.shape[:3]
    by_all = np.zeros((windows, count, 3, marked, 3, 18))  # of poses, twists and accelerations, 6 each
    by_all[:, :, 0, ..., :3], by_all[:, :, 0, ..., 3:6] = one, turned
    by_all[:, :, 1, ..., 3:6] = spin @ turned
    by_all[:, :, 1, ..., 6:9], by_all[:, :, 1, ..., 9:12] = one, -arms
    by_all[:, :, 2, ..., 3:6] = (spin_rate + spin @ spin) @ turned
    by_all[:, :, 2, ..., 9:12] = -swept - spin @ arms
    by_all[:, :, 2, ..., 12:15], by_all[:, :, 2, ..., 15:] = one, -arms
    moves = np.concatenate([by.poses[:, nodes], by.twists[:, nodes], by.accelerations[:, nodes]], axis=2)
    # one product a node: small ones, one for each marker, take three times as long
    varied = by_all.reshape(windows, count, 9 * marked, 18) @ moves
    return varied.reshape(windows, count, 3, marked, 3, -1)


def varied_at(
    trajectories: Trajectories, by: Variations, markers: Float[np.ndarray, "M 3"], times: Series
) -> Float[np.ndarray, "T M 3 P"]:
    """Derivatives of markers' positions (m) in the first window at some times (s of the grid).

    Only nodes beside a time are looked at, one marker at a time: of many columns each costs as much as the motion.
    """
    index, weights = hermite(trajectories.grid.t, times)
    nodes = np.unique(np.concatenate([index, index + 1]))
    place = np.searchsorted(nodes, index)
    each = (varied_at_nodes(trajectories, by, markers[[k]], nodes)[0] for k in range(len(markers)))
    return np.concatenate([between(nodal, place, weights) for nodal in each], axis=1)


def hermite(nodes: Series, times: Series) -> tuple[np.ndarray, Float[np.ndarray, "T 2 3"]]:
    """Interval of each time, and its weights of value, slope and curvature at the interval's two ends."""
    index = np.clip(np.searchsorted(nodes, times, side="right") - 1, 0, len(nodes) - 2)
    h = nodes[index + 1] - nodes[index]
    s = (times - nodes[index]) / h
    begin = _ends_weights(s, h)
    end = _ends_weights(1 - s, h) * np.array([1.0, -1.0, 1.0])
    return index, np.stack([begin, end], axis=1)


def between(nodal: Float[np.ndarray, "N 3 ..."], index: np.ndarray, weights: Float[np.ndarray, "T 2 3"]) -> np.ndarray:
    """Values at the times for which `hermite` gave index and weights; nodal: value, slope, curvature at each node."""
    count, shape = len(index), nodal.shape[2:]
    if np.prod(shape) < WIDE:
        ends = np.stack([nodal[index], nodal[index + 1]], axis=1)
        return (weights.reshape(-1, 1, 6) @ ends.reshape(count, 6, -1)).reshape(count, *shape)
    places = 3 * index[:, np.newaxis] + np.arange(6)
    rows = csr_array((weights.ravel(), places.ravel(), np.arange(0, 6 * count + 1, 6)), shape=(count, 3 * len(nodal)))
    return (rows @ nodal.reshape(3 * len(nodal), -1)).reshape(count, *shape)


def _ends_weights(s: Series, h: Series) -> Float[np.ndarray, "T 3"]:
    left = 1 - s
    return np.stack(
        [left**3 * (1 + 3 * s + 6 * s**2), left**3 * s * (1 + 3 * s) * h, left**3 * s**2 / 2 * h**2],
        axis=1,
    )


def _arms(trajectories: Trajectories, markers: np.ndarray) -> Float[np.ndarray, "W N M 3"]:
    return np.einsum("wnij,mj->wnmi", trajectories.rotations, markers)


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
