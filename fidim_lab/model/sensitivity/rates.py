"""What a gyroscope on the platform makes of its motion, with derivatives: the slot rate_read of effects.

The angular rate in the body's axes, Rᵀ ω, and its derivative by time, Rᵀ α, at the nodes; cubic Hermite polynomials
between: of an oscillation of 3 Hz they are good to 1e-4 of it. Bias and drift belong to the noise
(`identification.mle.trajectories.rate_likelihood`).
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from jaxtyping import Float

from fidim_lab.arrays import Series
from fidim_lab.model.batch import function, over_samples, rows
from fidim_lab.model.mechanism import Mechanism, parts
from fidim_lab.model.sensitivity.grid import Grid
from fidim_lab.model.sensitivity.integrate import Trajectories
from fidim_lab.model.sensitivity.variation import Variations
from fidim_lab.model.slots import Effect


def reads_rates(mechanism: Mechanism) -> bool:
    """Whether a gyroscope is what shows the motion: an effect says how it reads."""
    return any(type(effect).rate_read is not Effect.rate_read for effect in mechanism.effects)


@dataclass(frozen=True, eq=False)
class RateMeasurement:
    """A gyroscope at one θ; its readings are laid out as one marker's coordinates would be."""

    mechanism: Mechanism
    theta: Float[np.ndarray, " theta"]

    def latest(self, end: float) -> float:
        """True time (s) until which a motion must be known for stamps up to `end`."""
        return end

    def at_nodes(self, trajectories: Trajectories, markers: Float[np.ndarray, "M 3"]) -> Float[np.ndarray, "W N 2 3"]:
        """Angular rate (rad/s) and its derivative at the nodes, body axes."""
        spins = np.stack([trajectories.twists[..., 3:], trajectories.accelerations[..., 3:]], axis=2)
        return spins @ trajectories.rotations

    def varied_at_nodes(
        self, trajectories: Trajectories, by: Variations, markers: Float[np.ndarray, "M 3"]
    ) -> Float[np.ndarray, "W N 2 3 P"]:
        """Derivatives of `at_nodes` by the P columns: Rᵀ δω + (Rᵀ ω) × δφ, and the same of α."""
        nodal = self.at_nodes(trajectories, markers)
        turned = np.stack([by.twists[:, :, 3:], by.accelerations[:, :, 3:]], axis=2)
        back = np.swapaxes(trajectories.rotations, -1, -2)[:, :, np.newaxis]
        turns = by.poses[:, :, np.newaxis, 3:]
        return back @ turned + np.cross(nodal[..., np.newaxis], turns, axis=3)

    def seen(
        self,
        nodal: Float[np.ndarray, "N 2 3"],
        count: int,
        grid: Grid,
        stamps: Series,
        begin: float,
        extra: Float[np.ndarray, " extra"] | None = None,
    ) -> Float[np.ndarray, "T 1 3"]:
        """What is read at stamps (s since the recording's `begin`), rad/s."""
        return self._read(_between(nodal, grid.t, stamps))[0][:, np.newaxis]

    def seen_by(
        self,
        trajectories: Trajectories,
        place: int,
        markers: Float[np.ndarray, "M 3"],
        varied: Float[np.ndarray, "N 2 3 P"],
        stamps: Series,
        begin: float,
        extra: tuple[Float[np.ndarray, " extra"], Float[np.ndarray, "extra P"]] | None = None,
        *,
        held: bool = False,
    ) -> Float[np.ndarray, "T 1 3 P"]:
        """Derivatives of `seen` for the window at `place` of a batch; the last columns are those of θ, if not held."""
        nodes = trajectories.grid.t
        rates = _between(self.at_nodes(trajectories.only(place), markers)[0], nodes, stamps)
        _, by_rate, direct = self._read(rates)
        columns = by_rate @ _between(varied, nodes, stamps)
        if not held:
            columns[..., columns.shape[-1] - self.theta.size :] += direct
        return columns[:, np.newaxis]

    def _read(self, rates: Float[np.ndarray, "T 3"]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Readings (T, 3), their derivatives by the rates (T, 3, 3) and by θ (T, 3, theta)."""
        found = over_samples(self.mechanism.compiled("rates: read", _compile), len(rates), rates, self.theta)
        return found[0], found[1].reshape(-1, 3, 3), found[2].reshape(-1, 3, self.theta.size)


def _between(nodal: Float[np.ndarray, "N 2 ..."], nodes: Series, times: Series) -> Float[np.ndarray, "T ..."]:
    """Cubic Hermite polynomials from values and slopes at the nodes."""
    index = np.clip(np.searchsorted(nodes, times, side="right") - 1, 0, len(nodes) - 2)
    h = nodes[index + 1] - nodes[index]
    s = (times - nodes[index]) / h
    left = 1 - s
    weights = (left**2 * (1 + 2 * s), left**2 * s * h, s**2 * (3 - 2 * s), -(s**2) * left * h)
    ends = (nodal[index, 0], nodal[index, 1], nodal[index + 1, 0], nodal[index + 1, 1])
    shape = (-1, *(1 for _ in nodal.shape[2:]))
    return sum((weight.reshape(shape) * end for weight, end in zip(weights, ends, strict=True)), np.zeros(1))


def _compile(mechanism: Mechanism) -> ca.Function:
    """(rate, θ) → reading, its derivatives by the rate and by θ, row by row."""
    rate, theta = ca.SX.sym("rate", 3), ca.SX.sym("theta", mechanism.theta.size)
    read: ca.SX = rate
    for effect, part in parts(mechanism, theta):
        read = effect.rate_read(read, part)
    return function("rate_read", [rate, theta], [read, rows(ca.jacobian(read, rate)), rows(ca.jacobian(read, theta))])
