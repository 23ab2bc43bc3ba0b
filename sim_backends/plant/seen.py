"""Where the markers truly are, at a step of the plant or between two."""

from collections.abc import Iterator, Sequence

import numpy as np

from fidim_lab.errors import OurBugError
from sim_backends.plant.mechanics.kinematics import matrix_of, stalks, stalks_at
from sim_backends.plant.world import World


def markers_at(world: World, history: Sequence[tuple[float, np.ndarray]], t: float) -> np.ndarray:
    """True marker positions (M, 3), world frame, m, at time t within a history of (time, state), oldest first.

    Between two states by the cubic through their positions and velocities: within 0.1 µm over 5 ms.

    Raises:
        OurBugError: t is not within the history.
    """
    last, state = history[-1]
    if abs(t - last) < 1e-9:
        return _positions(world, state)
    for k in range(len(history) - 1, 0, -1):
        (t0, x0), (t1, x1) = history[k - 1], history[k]
        if t0 - 1e-9 <= t <= t1 + 1e-9 and t1 > t0:
            (p0, v0), (p1, v1) = _markers(world, x0), _markers(world, x1)
            return _hermite((t - t0) / (t1 - t0), t1 - t0, p0, v0, p1, v1)
    raise OurBugError(f"No marker positions at t = {t:.6f} s: the plant knows {history[0][0]:.4f}…{last:.4f} s.")


def _markers(world: World, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities of the markers (M, 3) in a state."""
    arms, turn = world.markers - world.body.com, matrix_of(x[3:7])
    speeds = x[7:10] + np.cross(x[10:13], arms) @ turn.T
    for across, tip in _stalks(world, x, turn):
        speeds[0] += across @ (tip[3:] - speeds[0])
    return _positions(world, x), speeds


def _positions(world: World, x: np.ndarray) -> np.ndarray:
    """Positions of the markers (M, 3) in a state."""
    turn = matrix_of(x[3:7])
    places = x[0:3] + (world.markers - world.body.com) @ turn.T
    for across, tip in _stalks(world, x, turn):
        places[0] += across @ (tip[:3] - places[0])
    return places


def _stalks(world: World, x: np.ndarray, turn: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Of each stalk of the main marker: what is across it (3, 3), and the state of its tip (6)."""
    first = stalks_at(world)
    for k, effect in enumerate(stalks(world)):
        along = turn @ effect.vector("ex", "ey", "ez")
        across = np.eye(3) - np.outer(along, along) / max(along @ along, 1e-12)
        yield across, x[first + 6 * k : first + 6 * k + 6]


def _hermite(u: float, dt: float, p0: np.ndarray, v0: np.ndarray, p1: np.ndarray, v1: np.ndarray) -> np.ndarray:
    """Cubic through two positions and velocities, dt apart, at the part u of the way."""
    rest = 1.0 - u
    start = rest * rest * ((1 + 2 * u) * p0 + u * dt * v0)
    return start + u * u * ((3 - 2 * u) * p1 - rest * dt * v1)
