"""A change of the body as a load would make it: a mass at one place, put on or taken off.

A load of μ times the platform's mass at r makes of s and I, per unit mass and about P (spec/model.md §1),

    s → (s + μ r) / (1 + μ),   I → (I + μ (r² 1 − r rᵀ)) / (1 + μ).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.optimize import least_squares
from scipy.stats import chi2

from fidim_lab.data.records import Body

UNLIKELY = 0.01
"""chance of a misfit as large, below which it was no load at one place: as rare as the project's other verdicts"""
SMALL = 1e-3
"""of the platform's mass: where the search begins; the mass is then found in a line, and the place follows it"""


@dataclass(frozen=True, eq=False)
class PointLoad:
    """A mass at one place of the body; negative where it was taken off."""

    share: float
    """of the platform's mass before"""
    share_sd: float
    at: Float[np.ndarray, "3"]
    """body axes, from P, m"""
    at_sd: Float[np.ndarray, "3"]


def load_of(body: Body, change: Float[np.ndarray, "9"], covariance: Float[np.ndarray, "9 9"]) -> PointLoad | None:
    """The load that changes a body so (`Body.vector`), with standard deviations; None where none at one place does.

    Its moment μ r follows from s, its mass from I beside it: where that is not seen, no place is told either.
    """
    whitening = np.linalg.inv(np.linalg.cholesky(covariance))

    def left(moment_and_share: np.ndarray) -> np.ndarray:
        share, at = moment_and_share[3], moment_and_share[:3] / moment_and_share[3]
        return whitening @ (changed(body, share, at) - change)

    tries = [least_squares(left, np.append(change[:3] + sign * SMALL * body.com, sign * SMALL)) for sign in (1.0, -1.0)]
    found = min(tries, key=lambda one: one.cost)
    if not 2 * found.cost < chi2.isf(UNLIKELY, len(change) - len(found.x)):
        return None
    jacobian = np.asarray(found.jac, dtype=float)
    spread = np.linalg.pinv(jacobian.T @ jacobian)
    moment, share = found.x[:3], float(found.x[3])
    by = np.column_stack([np.eye(3), -moment / share]) / share
    share_sd = float(np.sqrt(spread[3, 3]))
    if not abs(share) > 2 * share_sd:
        return None
    return PointLoad(share, share_sd, moment / share, np.sqrt(np.diag(by @ spread @ by.T)))


def changed(body: Body, share: float, at: Float[np.ndarray, "3"]) -> Float[np.ndarray, "9"]:
    """What a load adds to `Body.vector`."""
    point = Body.from_about_com(at, np.zeros((3, 3)))
    return (body.vector + share * point.vector) / (1 + share) - body.vector
