"""Least squares of many bodies at once: Levenberg and Marquardt's method over bodies that can exist.

The unknowns are the centre of mass and the logarithmic Cholesky factor of the second moments about it: whatever they
are, some distribution of mass has them (Rucker & Wensing 2022), and no step has to be refused for that.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from fidim_lab.identification.mle.periods.model import PeriodModel, Said
from fidim_lab.model.sensitivity.equations import BODY

ROUNDS = 30
"""at most; ten are usual"""
SETTLED = 1e-3
"""of the sum of squares: what one more step would gain of it"""
DAMPED, EASED, DAMPED_MORE, MOST = 1e-3, 0.2, 5.0, 1e6
"""damping over the curvature, at first and by what it changes; above the last nothing is gained any more"""
FLAT = 1e-6
"""curvature where there is none: moments that have become nothing change no more"""
THINNEST = 1e-4
"""m: a body is at least so thick (root mean square), or rounding decides whether it exists"""
SMALL = 1e-6
"""of the unknowns, for derivatives of what is computed exactly"""


@dataclass(frozen=True, eq=False)
class Found:
    """Where searches ended."""

    bodies: Float[np.ndarray, "B 9"]
    cost: Float[np.ndarray, " B"]
    """whole sum of squares, infinite where a search never hung"""
    left: Float[np.ndarray, " B"]
    """of the readings alone"""
    said: Said

    def best(self, other: "Found") -> "Found":
        """Of two searches for each body the better one."""
        rows = other.cost < self.cost
        said = self.said.of(np.arange(len(self.cost)))
        said.put(rows, other.said.of(rows))
        cost, left = np.where(rows, other.cost, self.cost), np.where(rows, other.left, self.left)
        return Found(np.where(rows[:, np.newaxis], other.bodies, self.bodies), cost, left, said)


def searched(
    model: PeriodModel,
    start: Float[np.ndarray, "B 9"],
    readings: Float[np.ndarray, "B M"],
    whitener: Float[np.ndarray, "M M"],
    prior: Float[np.ndarray, "B 9"],
    width: Float[np.ndarray, "9"],
) -> Found:
    """From each start, which can exist, the body nearest to its readings and its prior."""
    u = to_unknowns(start)
    bodies, said = start, model.said(start, model.start(len(start)))
    cost, left = _costs(bodies, said, readings, whitener, prior, width)
    damping = np.full(len(u), DAMPED)
    going = np.isfinite(cost)
    for _ in range(ROUNDS):
        rows = np.flatnonzero(going)
        if not len(rows):
            break
        slopes = _chain(u[rows])
        J = np.concatenate([whitener @ said.slopes[rows] @ slopes, slopes / width[:, np.newaxis]], axis=1)
        off = np.concatenate(
            [(said.readings[rows] - readings[rows]) @ whitener.T, (bodies[rows] - prior[rows]) / width], axis=1
        )
        normal, gradient = J.transpose(0, 2, 1) @ J, J.transpose(0, 2, 1) @ off[:, :, np.newaxis]
        size = np.einsum("bii->bi", normal)
        damped = normal + np.eye(BODY) * (FLAT + damping[rows, np.newaxis] * size)[:, np.newaxis]
        step = -np.linalg.solve(damped, gradient)[:, :, 0]
        gain = -np.sum(gradient[:, :, 0] * step, axis=1)
        tried = u[rows] + np.clip(step, -1.0, 1.0)
        tried[:, 3:6] = np.maximum(tried[:, 3:6], np.log(THINNEST))
        there = from_unknowns(tried)
        heard = model.said(there, tuple(rest.of(rows) for rest in said.rests))
        new, new_left = _costs(there, heard, readings[rows], whitener, prior[rows], width)
        better = new < cost[rows]
        taken = rows[better]
        said.put(taken, heard.of(better))
        u[taken], bodies[taken] = tried[better], there[better]
        cost[taken], left[taken] = new[better], new_left[better]
        damping[rows] *= np.where(better, EASED, DAMPED_MORE)
        going[rows] = ~((gain < SETTLED * (1 + cost[rows])) & better) & (damping[rows] < MOST)
    return Found(bodies, cost, left, said)


def _costs(
    bodies: np.ndarray, said: Said, readings: np.ndarray, whitener: np.ndarray, prior: np.ndarray, width: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    left = np.sum(((said.readings - readings) @ whitener.T) ** 2, axis=1)
    left = np.where(said.hangs, left, np.inf)
    return left + np.sum(((bodies - prior) / width) ** 2, axis=1), left


def to_unknowns(bodies: Float[np.ndarray, "B 9"]) -> Float[np.ndarray, "B 9"]:
    """Of bodies that can exist."""
    s = bodies[:, :3]
    inertia = bodies[:, [3, 6, 7, 6, 4, 8, 7, 8, 5]].reshape(-1, 3, 3)
    moments = np.trace(inertia, axis1=1, axis2=2)[:, np.newaxis, np.newaxis] / 2 * np.eye(3) - inertia
    root = np.linalg.cholesky(moments - s[:, :, np.newaxis] * s[:, np.newaxis])
    size = np.einsum("bii->bi", root)
    return np.hstack([s / LENGTH, np.log(size), root[:, [1, 2, 2], [0, 0, 1]] / LENGTH])


LENGTH = 0.1
"""m: unit of the unknowns that are lengths"""


def from_unknowns(u: Float[np.ndarray, "B 9"]) -> Float[np.ndarray, "B 9"]:
    """The bodies."""
    s, root = LENGTH * u[:, :3], np.zeros((len(u), 3, 3))
    root[:, [0, 1, 2], [0, 1, 2]] = np.exp(u[:, 3:6])
    root[:, [1, 2, 2], [0, 0, 1]] = LENGTH * u[:, 6:]
    moments = root @ root.transpose(0, 2, 1) + s[:, :, np.newaxis] * s[:, np.newaxis]
    inertia = np.trace(moments, axis1=1, axis2=2)[:, np.newaxis, np.newaxis] * np.eye(3) - moments
    return np.hstack([s, inertia[:, [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]])


def _chain(u: Float[np.ndarray, "B 9"]) -> Float[np.ndarray, "B 9 9"]:
    """Derivative of the body by the unknowns."""
    steps = SMALL * np.eye(BODY)[:, np.newaxis]
    both = from_unknowns((u + np.concatenate([steps, -steps])).reshape(-1, BODY)).reshape(2, BODY, len(u), BODY)
    return np.moveaxis((both[0] - both[1]) / (2 * SMALL), 0, 2)
