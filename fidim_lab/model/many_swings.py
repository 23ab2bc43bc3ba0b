"""ManyRests and small oscillations of many bodies at once, where a search asks for thousands of them.

The same equations as `equilibria` and `modes` (Eq. 37–39), over the first axis of arrays. A mode bears the name of what
a person sees move in it: by kinetic energy, turning about the vertical, the centre of mass along the line from the
first anchor to the second or across it, turning about level axes.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from jaxtyping import Bool, Float

from fidim_lab.arrays import skew
from fidim_lab.data.records import Robot
from fidim_lab.model.batch import over_samples
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.statics import NEUTRAL_STIFFNESS, Equilibrium, compiled_balance

MOTIONS: Mapping[str, str] = MappingProxyType(
    {
        "yaw": "turns about the vertical",
        "along": "sways along the line from anchor 1 to anchor 2",
        "across": "sways across that line",
        "rock": "turns about a level axis",
    }
)
"""names, and what the platform does"""
MASSLESS = 1e-12
"""of the largest inertia that a swing meets: below it there is none but rounding"""
LONGEST = 0.3
"""m and rad, of a step of Newton's method: the rest of another body is some steps away"""
STEPS, NEAR = 12, 1e-7
"""steps at most, and m and rad below which the next one is of no use: steps square, and derivatives are from there"""


@dataclass(frozen=True, eq=False)
class ManyRests:
    """Where B bodies rest, each at its own lengths, found or nearly."""

    positions: Float[np.ndarray, "B 3"]
    rotations: Float[np.ndarray, "B 3 3"]
    tensions: Float[np.ndarray, "B n"]
    """N/kg"""

    @staticmethod
    def all_at(rest: Equilibrium, many: int) -> "ManyRests":
        """So many alike."""
        one = rest.pose.position, rest.pose.rotation, rest.tensions
        return ManyRests(*(np.tile(value, (many, *(1,) * value.ndim)) for value in one))

    def of(self, rows: np.ndarray | slice) -> "ManyRests":
        """Some of them."""
        return ManyRests(self.positions[rows], self.rotations[rows], self.tensions[rows])

    def put(self, rows: np.ndarray, other: "ManyRests") -> None:
        """Let these rows be those of another."""
        self.positions[rows], self.rotations[rows] = other.positions, other.rotations
        self.tensions[rows] = other.tensions

    @staticmethod
    def joined(parts: "Sequence[ManyRests]") -> "ManyRests":
        """One after the other."""
        return ManyRests(
            np.concatenate([one.positions for one in parts]),
            np.concatenate([one.rotations for one in parts]),
            np.concatenate([one.tensions for one in parts]),
        )


@dataclass(frozen=True, eq=False)
class ManySwings:
    """Small oscillations of B bodies about their rests."""

    rests: ManyRests
    hangs: Bool[np.ndarray, " B"]
    """whether it can move and rests there stably, all cables taut; of others the numbers mean nothing"""
    squares: Float[np.ndarray, "B free"]
    """(2π f)², ascending; 0 for a neutral freedom"""
    shapes: Float[np.ndarray, "B 6 free"]
    """twists [ṗ; ω], world frame, each with γᵀ M γ = 1"""
    shares: Float[np.ndarray, "B 4 free"]
    """of each mode's motion, in the order of MOTIONS: nearly of 1 in all"""

    def of(self, rows: slice) -> "ManySwings":
        """Some of the bodies."""
        return ManySwings(
            self.rests.of(rows), self.hangs[rows], self.squares[rows], self.shapes[rows], self.shares[rows]
        )

    @property
    def log_periods(self) -> Float[np.ndarray, "B free"]:
        """ln of s; infinite for a neutral freedom."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.log(2 * np.pi) - 0.5 * np.log(self.squares)

    @property
    def slopes(self) -> Float[np.ndarray, "B free 6"]:
        """Of ln of the periods by the moments and products xx yy zz xy xz yz, 1/m²: half of γᵀ dM γ."""
        x, y, z = np.moveaxis(self.rests.rotations.transpose(0, 2, 1) @ self.shapes[:, 3:], 1, 0)
        return np.stack([x * x / 2, y * y / 2, z * z / 2, x * y, x * z, y * z], axis=2)


def many_swings(
    mechanism: Mechanism,
    bodies: Float[np.ndarray, "B 9"],
    lengths: Float[np.ndarray, "B n"],
    near: ManyRests,
    theta: Float[np.ndarray, "B theta"] | None = None,
) -> ManySwings:
    """Of each body at its lengths (m), its rest sought from `near`; theta: of the mechanism unless given."""
    theta = mechanism.theta if theta is None else theta
    rests, hessian, xi, found = _rests(mechanism, bodies[:, :3], lengths, near, theta)
    R, held, n = rests.rotations, rests.tensions, mechanism.n
    free = np.linalg.svd(xi)[2][:, n:].transpose(0, 2, 1)
    mass = free.transpose(0, 2, 1) @ _masses(bodies, R) @ free
    inertias = np.linalg.eigvalsh(mass)
    moves = inertias[:, 0] > MASSLESS * inertias[:, -1]
    mass[~moves] = np.eye(mass.shape[1])
    squares, vectors = _solved(free.transpose(0, 2, 1) @ hessian @ free, mass)
    least = NEUTRAL_STIFFNESS * squares.max(axis=1)
    hangs = found & moves & (held.min(axis=1) > 0) & (squares.min(axis=1) > -least)
    squares = np.where(np.abs(squares) <= least[:, np.newaxis], 0.0, squares)
    shapes = free @ vectors
    return ManySwings(rests, hangs, squares, shapes, _shares(mechanism.robot, bodies, R, shapes))


def _rests(
    mechanism: Mechanism, coms: np.ndarray, lengths: np.ndarray, near: ManyRests, theta: np.ndarray
) -> tuple[ManyRests, np.ndarray, np.ndarray, np.ndarray]:
    """By Newton's method on the stationary Lagrangian; with Hessian (B, 6, 6) and Ξ there, and which were found.

    Derivatives are those of the last step, from less than NEAR away.
    """
    compiled, many, n = compiled_balance(mechanism), len(coms), mechanism.n
    p, R, held = near.positions.copy(), near.rotations.copy(), near.tensions.copy()
    hessian, xi, size = np.zeros((many, 6, 6)), np.zeros((many, n, 6)), np.full(many, np.inf)
    for _ in range(STEPS):
        at = np.flatnonzero(size > NEAR)
        if not len(at):
            break
        own = theta if theta.ndim == 1 else theta[at]
        gradient, second, first, actual = over_samples(compiled, len(at), p[at], R[at], held[at], coms[at], own)
        second, first = second.reshape(-1, 6, 6), first.reshape(-1, n, 6)
        system = np.block([[second, first.transpose(0, 2, 1)], [first, np.zeros((len(at), n, n))]])
        wanted = -np.concatenate([gradient, actual - lengths[at]], axis=1)[:, :, np.newaxis]
        # a lone cable leaves the system singular: spin about it is neutral
        step = (np.linalg.pinv(system, rcond=1e-10) @ wanted if n == 1 else np.linalg.solve(system, wanted))[:, :, 0]
        largest = np.abs(step[:, :6]).max(axis=1)
        step *= np.minimum(1.0, LONGEST / np.maximum(largest, 1e-300))[:, np.newaxis]
        p[at] += step[:, :3]
        R[at] = _turns(step[:, 3:6]) @ R[at]
        held[at] += step[:, 6:]
        hessian[at], xi[at], size[at] = second, first, largest
    lost = ~np.isfinite(p.sum(axis=1) + hessian.sum(axis=(1, 2)) + held.sum(axis=1))
    for kept, before in ((p, near.positions), (R, near.rotations), (held, near.tensions)):
        kept[lost] = before[lost]
    hessian[lost], xi[lost] = 0.0, 0.0
    return ManyRests(p, R, held), hessian, xi, (size < NEAR) & ~lost


def tilts(robot: Robot, rests: ManyRests) -> Float[np.ndarray, "B 2"]:
    """What an inclinometer on the platform reads at rest: rotations about x, then y, rad."""
    up = -robot.gravity / np.linalg.norm(robot.gravity)
    x, y, z = (up @ rests.rotations).T
    return np.stack([np.arctan2(y, z), -np.arcsin(np.clip(x, -1, 1))], axis=1)


def _solved(stiffness: np.ndarray, mass: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Squares and vectors of K v = λ M v, of each pair."""
    root = np.linalg.inv(np.linalg.cholesky(mass))
    squares, vectors = np.linalg.eigh(root @ stiffness @ root.transpose(0, 2, 1))
    return squares, root.transpose(0, 2, 1) @ vectors


def _turns(small: Float[np.ndarray, "B 3"]) -> Float[np.ndarray, "B 3 3"]:
    """Rotations R(δθ/2) as `statics.balance` means its steps."""
    cross = skew(small / 2)
    return np.eye(3) + (2 / (1 + np.sum(small**2, axis=1) / 4))[:, np.newaxis, np.newaxis] * (cross + cross @ cross)


def _inertia(bodies: Float[np.ndarray, "B 9"]) -> Float[np.ndarray, "B 3 3"]:
    """About P, body frame, m²."""
    return bodies[:, [3, 6, 7, 6, 4, 8, 7, 8, 5]].reshape(-1, 3, 3)


def _masses(bodies: np.ndarray, rotations: np.ndarray) -> np.ndarray:
    """M/m of Eq. 9, world frame."""
    cross = skew((rotations @ bodies[:, :3, np.newaxis])[:, :, 0])
    turned = rotations @ _inertia(bodies) @ rotations.transpose(0, 2, 1)
    return np.block([[np.tile(np.eye(3), (len(bodies), 1, 1)), -cross], [cross, turned]])


def _shares(robot: Robot, bodies: np.ndarray, rotations: np.ndarray, shapes: np.ndarray) -> np.ndarray:
    """Of each mode's kinetic energy, in the order of MOTIONS."""
    up = -robot.gravity / np.linalg.norm(robot.gravity)
    line = robot.cables[1].d - robot.cables[0].d if robot.n > 1 else np.array([1.0, 0.0, 0.0])
    line = line - up * (line @ up)
    along = line / np.linalg.norm(line)
    arms = (rotations @ bodies[:, :3, np.newaxis])[:, :, 0]
    velocities = shapes[:, :3] - skew(arms) @ shapes[:, 3:]
    about_com = _inertia(bodies) - skew(bodies[:, :3]).transpose(0, 2, 1) @ skew(bodies[:, :3])
    inertia = rotations @ about_com @ rotations.transpose(0, 2, 1)
    momenta = inertia @ shapes[:, 3:]
    yaw = (up @ shapes[:, 3:]) * (up @ momenta)
    turning = np.sum(shapes[:, 3:] * momenta, axis=1)
    return np.stack([yaw, (along @ velocities) ** 2, (np.cross(up, along) @ velocities) ** 2, turning - yaw], axis=1)
