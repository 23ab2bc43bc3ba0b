"""A family with its best shape as an effect, so that it can be fitted jointly with exact derivatives.

θ are the combinations of weights that the data determine, each in units of its own prior, and what the shape moves from
where it was found, in units of the search's first steps: θ ~ N(0, 1).
"""

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import casadi as ca
import numpy as np
from jaxtyping import Float

from fidim_lab.effects.effect import NamedEffect, Parameter
from fidim_lab.effects.loads.oscillation import PHASE
from fidim_lab.mismatch.unknown_force.evidence import Weighed
from fidim_lab.mismatch.unknown_force.family import Family
from fidim_lab.mismatch.unknown_force.thresholds import UNKNOWN_FORCE
from fidim_lab.model.slots import ExtraState, PlatformState

PHASES = tuple(float(x) for x in np.linspace(-np.pi, np.pi, 8, endpoint=False))
"""rad, from which a window's own is looked for: what is short has harmonics"""


@dataclass(frozen=True, eq=False)
class LatentForce(NamedEffect):
    """W = basis θ; `family` says what the wrench is made of."""

    id: ClassVar[str] = "unknown"
    says: ClassVar[str] = "a smooth wrench of unknown cause, fitted to the unexplained residual"
    source: ClassVar[str] = "latent-force model: Álvarez, Luengo, Lawrence, AISTATS 2009"

    family: Family | None = None
    shape: Float[np.ndarray, " shape"] | None = None
    basis: Float[np.ndarray, "Q r"] | None = None
    start_at: Float[np.ndarray, " r"] | None = None
    phases: Float[np.ndarray, " W"] | None = None
    """rad, of each window that it was weighed on, where windows meet it at times of their own"""

    @staticmethod
    def of(found: Weighed) -> "LatentForce":
        """With the combinations of weights that matter; starts at the weights that were weighed."""
        scaled = found.curvature * np.outer(found.prior_sd, found.prior_sd)
        values, vectors = np.linalg.eigh(scaled)
        order = np.argsort(-values)[: UNKNOWN_FORCE.latent_most]
        order = (
            order[values[order] / (1 + values[order]) > UNKNOWN_FORCE.latent_determined] if len(values) > 3 else order
        )
        order = order if len(order) else np.array([int(np.argmax(values))])
        basis = found.prior_sd[:, np.newaxis] * vectors[:, order]
        basis = basis if found.combined is None else found.combined @ basis
        start = vectors[:, order].T @ (found.weights / found.prior_sd)
        kind = LatentForce if found.phases is None else LatentForceOwnTime
        return kind(family=found.family, shape=found.shape, basis=basis, start_at=start, phases=found.phases)

    @property
    def _steps(self) -> Float[np.ndarray, " shape"]:
        """Sizes of the last θ, by which the shape moves while it is fitted; none where a shape is not searched."""
        steps = None if self.family is None else self.family.steps
        return np.zeros(0) if steps is None else steps

    @property
    def parameters(self) -> tuple[Parameter, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """One for each column of the basis, then one for each entry of the shape that moves."""
        count = 0 if self.basis is None else self.basis.shape[1] + len(self._steps)
        return tuple(
            Parameter(f"u{k}", "1", "any strength", scale=1.0, low=-np.inf, high=np.inf, start=0.0)
            for k in range(1, count + 1)
        )

    @property
    def start(self) -> Float[np.ndarray, " r"]:
        """The weights found by evidence."""
        return np.zeros(0) if self.start_at is None else np.append(self.start_at, np.zeros(len(self._steps)))

    def weights(self, theta: Float[np.ndarray, " r"]) -> Float[np.ndarray, " Q"]:
        """Of the family's products."""
        return np.zeros(0) if self.basis is None else self.basis @ theta[: self.basis.shape[1]]

    def shape_at(self, theta: Float[np.ndarray, " r"]) -> Float[np.ndarray, " shape"]:
        """Of the family, as fitted."""
        shape = np.zeros(0) if self.shape is None else self.shape
        return shape + self._steps * theta[len(theta) - len(self._steps) :] if len(self._steps) else shape

    def wrench(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """The family's, at the platform."""
        if self.family is None or self.shape is None or self.basis is None:
            return ca.SX.zeros(6)
        weights = ca.SX(ca.DM(self.basis)) @ theta[: self.basis.shape[1]]
        return self.family.wrench(state, self.moved(theta), weights)

    def moved(self, theta: ca.SX) -> ca.SX:
        """The shape for θ, as an expression."""
        shape = ca.SX(ca.DM(np.zeros(0) if self.shape is None else self.shape))
        return shape + ca.DM(self._steps) * theta[theta.numel() - len(self._steps) :] if len(self._steps) else shape

    def own_time(self, time: Any, shape: Any, phase: Any) -> Any:
        """The time at which it is, where a window meets it at that phase (rad): numbers or expressions."""
        return time + phase / (2 * np.pi * shape[0])


@dataclass(frozen=True, eq=False)
class LatentForceOwnTime(LatentForce):
    """The same where each window meets it at a time of its own: a phase that counts as part of the window's start."""

    extra_states: ClassVar[tuple[ExtraState, ...]] = (replace(PHASE, tries=PHASES),)

    def wrench(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """The family's, at the window's own time."""
        return super().wrench(replace(state, time=self.own_time(state.time, self.moved(theta), state.extra[0])), theta)
