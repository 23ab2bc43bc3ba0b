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
    """C of the stacked regressor of all windows: dC = u₁ᵀ dW v₁ / s₉ − (s₁ + 1)/s₉² u₉ᵀ dW v₉, with u = W v / s."""
    motions = sensitive.motions
    at = motions.sampled
    chosen = motions.regressors[:, at]
    # of the small table: C matters where it is below 1e3, where squaring it costs no digit that counts
    W = chosen.reshape(-1, 10)
    values, vectors = np.linalg.eigh(W.T @ W)
    s, Vt = np.sqrt(np.maximum(values[::-1], 1e-30)), vectors.T[::-1]
    by_first = (chosen @ Vt[0])[..., np.newaxis] * Vt[0] / s[0] / s[8]
    by_last = (chosen @ Vt[8])[..., np.newaxis] * Vt[8] * (s[0] + 1) / s[8] ** 3
    nodes = np.broadcast_to(at, (len(chosen), len(at)))
    weights = sensitive.weighted(regressors=by_first - by_last)
    return Cost(float((s[0] + 1) / s[8]), sensitive.at_nodes(mechanism, nodes, weights).sum(axis=1))
