"""The equations of motion of a window in small pieces: the imbalance that a hand on the platform leaves.

With locked motors the Newton–Euler equations, projected on the twists that the cables leave free, balance by
themselves (Eq. 21). Markers are differentiated by a polynomial through `HALF` seconds on either side of each node:
short enough to say when a hand lets go, and with nodes up to the ends of a recording. A quartic has little noise, and
rounds off sharp turns, which ill-placed markers magnify: where it loses more than a finer polynomial has noise, that
one is taken.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from fidim_lab.arrays import Series
from fidim_lab.data.records import Campaign, Motion, Robot, Window
from fidim_lab.errors import FidimError, InfeasibleError
from fidim_lab.identification.motion import rigid, surface
from fidim_lab.identification.motion.measured import held_lengths, rest_pose
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.regressor import parameter_vector, platform_regressor

EVERY = 0.1
"""s between nodes"""
HALF = 0.15
"""s on either side of a node: swings of 3 Hz lose a twentieth of their acceleration"""
DEGREES = (4, 6)
"""of the two polynomials; an odd one has the accelerations of the even one below it"""
SPARE = 3
"""samples beyond the coefficients of the polynomial, without which a node is not judged"""
ASTRAY = 0.02
"""m between markers and pose, rms, beyond which a node says nothing of forces: it is no pose of this robot"""


@dataclass(frozen=True, eq=False)
class WindowBalance:
    """One window's projected equations of motion, linear in χ = [1, s, I] (Eq. 22), per unit mass."""

    window: Window
    t: Series
    """s on the window's own clock, of the nodes that can be judged"""
    left: Float[np.ndarray, "N free 10"]
    """times χ: what does not balance, m/s²"""
    inertial: Float[np.ndarray, "N free 10"]
    """times χ: the inertial part of it, m/s²"""
    noise: Series
    """(N,) (m/s²)²: mean square of what does not balance that noise of the markers makes, for the nominal body; large
    where few markers hardly show a free motion (three cables, one marker)"""
    speeds: Series
    """(N,) m/s: of the markers, rms"""


def balance(mechanism: Mechanism, window: Window) -> WindowBalance | None:
    """The balance of a window; None where its pose is not known at every node, or where there are too few nodes."""
    robot = mechanism.robot
    body = robot.markers[: window.markers.shape[1]]
    seen = np.isfinite(window.markers).all(axis=2).mean(axis=0) > 0.5
    if not seen.any():
        return None
    nodes = _differentiated(window, np.flatnonzero(seen), robot.sensors.marker_noise)
    if len(nodes.t) < SPARE:
        return None
    try:
        motion = _motion(mechanism, window, nodes, body[seen])
        free = surface.free_directions(mechanism.structure_matrix(motion.positions, motion.rotations))
        noise = _noise(mechanism.robot, motion, free, body[seen]) * nodes.gains[np.searchsorted(nodes.t, motion.t)] ** 2
    except (FidimError, np.linalg.LinAlgError):
        return None
    speeds = np.sqrt((nodes.speed**2).sum(axis=2).mean(axis=1))[np.searchsorted(nodes.t, motion.t)]
    across = np.swapaxes(free, 1, 2)
    left = across @ platform_regressor(motion, robot.gravity)
    inertial = across @ platform_regressor(motion, np.zeros(3))
    return WindowBalance(window, motion.t, left, inertial, noise, speeds)


def balances_of(campaign: Campaign) -> tuple[WindowBalance, ...]:
    """Of all windows whose poses are known."""
    mechanism = Mechanism(campaign.robot)
    return tuple(found for window in campaign.windows if (found := balance(mechanism, window)) is not None)


def blocks(one: WindowBalance, length: float) -> list[tuple[Float[np.ndarray, "R 10"], Float[np.ndarray, "R 10"]]]:
    """Rows of about so many seconds each: what is left over, and inertial forces, times χ."""
    count = max(1, round(len(one.t) * EVERY / length))
    pieces = np.array_split(np.arange(len(one.t)), count)
    return [(one.left[k].reshape(-1, 10), one.inertial[k].reshape(-1, 10)) for k in pieces if len(k)]


def _noise(robot: Robot, motion: Motion, free: Float[np.ndarray, "N 6 free"], body: Float[np.ndarray, "M 3"]) -> Series:
    """(N,) mean square of what does not balance (m/s²)², for accelerations of markers whose noise is `marker_noise`.

    That of accelerations alone: places are better known by far than gravity makes of their errors.
    """
    still = replace(motion, twists=np.zeros_like(motion.twists))
    units = (replace(still, accelerations=np.tile(one, (len(motion.t), 1))) for one in np.eye(6))
    columns = [platform_regressor(unit, np.zeros(3)) @ parameter_vector(robot.nominal) for unit in units]
    shown = np.linalg.pinv(surface.marker_jacobian(motion.rotations, body) @ free)
    made = np.swapaxes(free, 1, 2) @ np.stack(columns, axis=2) @ free @ shown
    return robot.sensors.marker_noise**2 * (made**2).sum(axis=(1, 2))


@dataclass(frozen=True, eq=False)
class _Nodes:
    t: Series
    place: Float[np.ndarray, "N M 3"]
    speed: Float[np.ndarray, "N M 3"]
    acceleration: Float[np.ndarray, "N M 3"]
    gains: Series
    """1/s²: standard deviation of an acceleration over that of a sample"""

    def at(self, use: np.ndarray) -> "_Nodes":
        return _Nodes(self.t[use], self.place[use], self.speed[use], self.acceleration[use], self.gains[use])


def _differentiated(window: Window, markers: np.ndarray, noise: float) -> _Nodes:
    """By the polynomial whose errors, of what it rounds off and of noise (m), are smaller over the window."""
    coarse, finer = (_by_polynomials(window, markers, degree) for degree in DEGREES)
    if len(finer.t) < len(coarse.t) or not len(coarse.t):
        return coarse
    differ = ((finer.acceleration - coarse.acceleration) ** 2).mean()
    by_noise = noise**2 * ((finer.gains**2).mean() - (coarse.gains**2).mean())
    return finer if differ - by_noise > by_noise else coarse  # rounded off by the one; more noise of the other


def _by_polynomials(window: Window, markers: np.ndarray, degree: int) -> _Nodes:
    """Through the samples about each node, of all these markers; without nodes where one lacks samples."""
    t, tracks = window.t, window.markers[:, markers].reshape(len(window.t), -1)
    whole = np.isfinite(tracks).all(axis=1)
    t, tracks = t[whole], tracks[whole]
    found: list[tuple[float, np.ndarray]] = []
    gains: list[float] = []
    if len(t):
        for at in np.arange(window.t[0] + HALF, window.t[-1] - HALF + 1e-9, EVERY):
            begin, end = np.searchsorted(t, (at - HALF - 1e-9, at + HALF + 1e-9))
            if end - begin < degree + 1 + SPARE or not (t[begin] < at - HALF / 2 and t[end - 1] > at + HALF / 2):
                continue
            powers = np.vander((t[begin:end] - at) / HALF, degree + 1, increasing=True)
            fitted = np.linalg.pinv(powers)
            found.append((float(at), fitted[:3] @ tracks[begin:end]))
            gains.append(2 / HALF**2 * float(np.linalg.norm(fitted[2])))
    times = np.array([at for at, _ in found])
    values = np.array([one for _, one in found]).reshape(len(found), 3, len(markers), 3)
    return _Nodes(times, values[:, 0], values[:, 1] / HALF, 2 * values[:, 2] / HALF**2, np.array(gains))


def _motion(mechanism: Mechanism, window: Window, nodes: _Nodes, body: Float[np.ndarray, "M 3"]) -> Motion:
    """Poses, twists and accelerations: from the markers alone where they show the whole pose, else tied to lengths."""
    whole = rigid.spread(body) > rigid.MIN_SPREAD
    if whole:
        positions, rotations, misfit = rigid.register(nodes.place, body, np.ones(nodes.place.shape[:2]))
    else:
        found = surface.poses(mechanism, held_lengths(window), body, nodes.place, rest_pose(mechanism, window))
        positions, rotations, misfit = found.positions, found.rotations, found.misfit
        misfit = np.where(found.settled, misfit, np.inf)
    use = np.flatnonzero(misfit < ASTRAY)
    if len(use) < SPARE:
        raise InfeasibleError(f"Window {window.id}: no pose fits its markers.")
    nodes, poses = (
        nodes.at(use),
        surface.SurfacePoses(positions[use], rotations[use], misfit[use], np.ones(len(use), bool)),
    )
    J = surface.marker_jacobian(poses.rotations, body)
    speeds = nodes.speed.reshape(len(use), -1)
    twists = _solved(J, speeds) if whole else surface.rates(mechanism, poses, J, speeds)
    wanted = nodes.acceleration.reshape(len(use), -1) - surface.centripetal(poses.rotations, twists, body)
    rates = _solved(J, wanted) if whole else surface.accelerations(mechanism, poses, J, twists, wanted)
    return Motion(nodes.t, poses.positions, poses.rotations, twists, rates)


def _solved(J: surface.Jacobian, wanted: Float[np.ndarray, "N K"]) -> Float[np.ndarray, "N 6"]:
    across = np.swapaxes(J, 1, 2)
    return np.linalg.solve(across @ J, (across @ wanted[..., np.newaxis]))[..., 0]
