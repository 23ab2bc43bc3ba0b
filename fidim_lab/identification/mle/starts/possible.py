"""Possible bodies: the nearest one as a start, what is plausible, and the distance to the boundary."""

import numpy as np
from jaxtyping import Float

from fidim_lab.data.records import Body
from fidim_lab.identification.equations.consistency import pseudo_inertia, second_moments

SLIMMEST = 0.05
"""a principal second moment about G below this share of the largest is raised to it, at a start only"""


def nearest_possible(body: Body) -> Body:
    """The same centre of mass, and about G the nearest second moments none of which is below SLIMMEST of the largest.

    Principal moments ∫ x² dm/m, nearest in the Frobenius norm; the body itself where that holds already.
    """
    spread = second_moments(body.inertia_about_com)
    moments, axes = np.linalg.eigh(spread)
    floor = SLIMMEST * max(float(moments[-1]), 1e-3 * _gyration(body) ** 2)
    if moments[0] >= floor:
        return body
    spread = (axes * np.maximum(moments, floor)) @ axes.T
    return Body.from_about_com(body.com, np.trace(spread) * np.eye(3) - spread)


def scales(body: Body) -> Float[np.ndarray, "9"]:
    """How much the true body may plausibly differ from this one: the size of a weak prior, m and m².

    Centre of mass: half its distance and a tenth of the radius of gyration; moments: their own size; products: a tenth
    of the largest moment.
    """
    moments = np.abs(body.inertia[:3])
    com = 0.5 * np.abs(body.com) + 0.1 * _gyration(body)
    return np.concatenate([com, np.maximum(moments, 0.1 * moments.max()), np.full(3, 0.1 * moments.max())])


def distance_to_boundary(body: Body, covariance: Float[np.ndarray, "9 9"]) -> tuple[float, float]:
    """Distance to bodies that cannot exist: smallest eigenvalue of the pseudo-inertia, absolute and in sd.

    Negative where it cannot exist. The eigenvalue u·J u is in m² for the most part (Rucker & Wensing 2022).
    """
    values, vectors = np.linalg.eigh(pseudo_inertia(body))
    u = vectors[:, 0]
    at = body.vector
    slopes = np.array(
        [u @ (pseudo_inertia(Body.from_vector(at + unit)) - pseudo_inertia(body)) @ u for unit in np.eye(9)]
    )
    sd = float(np.sqrt(max(slopes @ covariance @ slopes, 0.0)))
    return float(values[0]), float(values[0]) / sd if sd > 0 else np.inf


def _gyration(body: Body) -> float:
    """Radius of gyration about P, m."""
    return float(np.sqrt(max(np.trace(body.inertia_matrix) / 2, body.com @ body.com, 1e-6)))
