"""A marker cluster as a rigid body: its pose at every sample, and its shape when nobody measured it.

`fit_pose` when the markers' places in the body are known (a robot file with three or more markers); `cluster_shape`
when they are not (a fresh recording), followed by `fit_pose` with the shape found. Pure functions of arrays.

Source: Kabsch, Acta Cryst. A32 (1976) 922, in its SVD form (Arun et al., IEEE PAMI 9 (1987) 698); generalised
Procrustes analysis: Gower, Psychometrika 40 (1975) 33.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from fidim_lab.arrays import Positions, Rotations, Series
from fidim_lab.errors import RefusedError

MarkerSeries = Float[np.ndarray, "N M 3"]
MarkerShape = Float[np.ndarray, "M 3"]
PerMarker = Float[np.ndarray, "M"]

FLAT = 1e-9
"""share of the largest singular value under which the markers seen lie on one line, a rotation about it being free"""
MOST_ROUNDS = 50
SETTLED = 1e-12
"""m, change of the shape at which the generalised Procrustes rounds end"""
SPOILT = 5.0
"""samples that fit this many times worse than the median (a swapped marker, a jump) do not shape the cluster"""


@dataclass(frozen=True, eq=False)
class ClusterShape:
    """Where the markers sit relative to each other, in a frame of the cluster's own (origin at their mean)."""

    markers: MarkerShape
    """m"""
    rms: float
    """m, root mean square misfit of one marker coordinate over the samples used"""
    rms_per_marker: PerMarker
    """m"""
    noise: float
    """m, standard deviation of one marker coordinate: `rms` with the six freedoms of each pose paid for"""
    samples_used: int
    rounds: int


def fit_pose(
    markers: MarkerSeries, body_markers: MarkerShape, weights: Float[np.ndarray, "N M"] | None = None
) -> tuple[Positions, Rotations, Series]:
    """The pose that carries the body's markers best onto the measured ones, in the least-squares sense, per sample.

    Args:
        markers: (N, M, 3) measured, world frame, m; NaN where a marker was not seen.
        body_markers: (M, 3) the same markers in the body frame, m.
        weights: (N, M) of their squared misfits, not negative; 0 is as not seen, None all alike.

    Returns:
        positions (N, 3) of the body frame's origin, world frame, m; rotations (N, 3, 3) body → world; rms (N,) misfit
        of one coordinate, m. All NaN where fewer than three markers are seen, or those seen lie on one line.
    """
    given = np.ones(markers.shape[:2]) if weights is None else weights
    seen = np.all(np.isfinite(markers), axis=2) & (given > 0)
    weight = np.where(seen, given, 0.0)
    weight = weight / np.maximum(weight.sum(axis=1, keepdims=True), np.finfo(float).tiny)
    known = np.where(seen[:, :, None], markers, 0.0)
    world_mean = np.einsum("nm,nmi->ni", weight, known)
    body_mean = weight @ body_markers
    from_world = known - world_mean[:, None]
    from_body = body_markers - body_mean[:, None]

    rotations, solvable = _best_rotations(np.einsum("nm,nmi,nmj->nij", weight, from_body, from_world))
    misfit = from_world - np.einsum("nij,nmj->nmi", rotations, from_body)
    rms = np.sqrt(np.einsum("nm,nmi,nmi->n", weight, misfit, misfit) / 3.0)
    positions = world_mean - np.einsum("nij,nj->ni", rotations, body_mean)

    unknown = ~solvable | (seen.sum(axis=1) < 3)
    positions[unknown], rotations[unknown], rms[unknown] = np.nan, np.nan, np.nan
    return positions, rotations, rms


def cluster_shape(markers: MarkerSeries) -> ClusterShape:
    """The rigid shape that all samples agree on best (generalised Procrustes), from (N, M, 3) world positions, m.

    The frame is the cluster's own: origin at the markers' mean, axes those of the world at the first whole sample.

    Raises:
        RefusedError: fewer than three markers, markers on one line, or no sample in which all of them are seen.
    """
    whole = np.all(np.isfinite(markers), axis=(1, 2))
    if markers.shape[1] < 3 or not whole.any():
        raise RefusedError(
            f"A rigid body needs three markers that are all seen at once; there are {markers.shape[1]} markers"
            f" and {int(whole.sum())} of {len(markers)} samples with all of them.",
            hint="Label the platform's markers again and fill short gaps in the motion-capture software.",
        )
    shape = markers[int(np.argmax(whole))]
    shape = shape - shape.mean(axis=0)
    rounds, change = 0, np.inf
    used = whole
    while rounds < MOST_ROUNDS and change > SETTLED:
        positions, rotations, rms = fit_pose(markers, shape)
        if np.isnan(rms).all():
            raise RefusedError("The markers lie on one line, so a rotation about it cannot be seen.")
        used = rms <= SPOILT * np.nanmedian(rms) + SETTLED
        in_cluster = np.einsum("nji,nmj->nmi", rotations[used], markers[used] - positions[used, None])
        better = np.nanmean(in_cluster, axis=0)
        better -= better.mean(axis=0)
        change, shape, rounds = float(np.abs(better - shape).max()), better, rounds + 1
    return _describe(markers[used], shape, rounds)


def _describe(markers: MarkerSeries, shape: MarkerShape, rounds: int) -> ClusterShape:
    positions, rotations, _ = fit_pose(markers, shape)
    misfit = markers - positions[:, None] - np.einsum("nij,mj->nmi", rotations, shape)
    squares = misfit**2
    coordinates = int(np.isfinite(squares).sum())
    freedom = coordinates - 6 * len(markers) - (shape.size - 6)
    return ClusterShape(
        markers=shape,
        rms=float(np.sqrt(np.nanmean(squares))),
        rms_per_marker=np.sqrt(np.nanmean(squares, axis=(0, 2))),
        noise=float(np.sqrt(np.nansum(squares) / max(freedom, 1))),
        samples_used=len(markers),
        rounds=rounds,
    )


def _best_rotations(correlation: Rotations) -> tuple[Rotations, np.ndarray]:
    """Proper rotations R maximising tr(R Σ b wᵀ) for (N, 3, 3) sums of body ⊗ world, and where they are unique."""
    left, size, right_t = np.linalg.svd(correlation)
    mirrored = np.linalg.det(left @ right_t) < 0.0
    right_t[mirrored, 2] *= -1.0
    rotations = np.swapaxes(left @ right_t, 1, 2).copy()
    return rotations, size[:, 1] > FLAT * np.maximum(size[:, 0], np.finfo(float).tiny)
