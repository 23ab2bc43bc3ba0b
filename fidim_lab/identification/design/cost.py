"""The paper's criterion (Eq. 40) with its derivative by the design's unknowns."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from fidim_lab.identification.design.motions import Sensitive
from fidim_lab.model.mechanism import Mechanism


@dataclass(frozen=True, eq=False)
class Cost:
    """A value and its derivative by each window's z."""

    value: float
    gradient: Float[np.ndarray, "W z"]


def criterion(W: Float[np.ndarray, "rows 10"]) -> float:
    """C = (s_1 + 1) / s_9 (Eq. 40)."""
    s = np.linalg.svd(W, compute_uv=False)
    return float((s[0] + 1) / s[8])


def excitation(mechanism: Mechanism, sensitive: Sensitive) -> Cost:
    """C of the stacked regressor of all windows: dC = u₁ᵀ dW v₁ / s₉ − (s₁ + 1)/s₉² u₉ᵀ dW v₉."""
    motions = sensitive.motions
    at = motions.sampled
    chosen = motions.regressors[:, at]
    U, s, Vt = np.linalg.svd(chosen.reshape(-1, 10), full_matrices=False)
    by_entries = np.outer(U[:, 0], Vt[0]) / s[8] - (s[0] + 1) / s[8] ** 2 * np.outer(U[:, 8], Vt[8])
    weights = np.zeros_like(motions.regressors)
    weights[:, at] = by_entries.reshape(chosen.shape)
    none = (np.zeros_like(motions.tensions), np.zeros_like(motions.dependent))
    return Cost(float((s[0] + 1) / s[8]), sensitive.at_nodes(mechanism, weights, *none).sum(axis=1))
