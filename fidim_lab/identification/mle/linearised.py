"""The sum of squares near an optimum as a quadratic function, and the evidence of models that free some of it.

Evidence is Laplace's, of a normal prior about 0 on all but the body: what data and prior leave, and the Occam factor
½ ln det(I + prior covariance × information), with the data's part divided by χ²/dof where that is above 1.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from fidim_lab.identification.mle.spread import Quadratic
from fidim_lab.identification.mle.trajectories.normal import Reduced
from fidim_lab.model.sensitivity.equations import BODY

SETTLING = 4
"""rounds in which χ²/dof and the best point agree to a thousandth"""


@dataclass(frozen=True)
class There:
    """The best point of some of the shared parameters, the others held where they do nothing."""

    left: float
    """data's sum of squares"""
    strain: float
    """prior's"""
    occam: float
    """ln det of information and prior, times prior variances of θ"""

    def nats(self, temper: float) -> float:
        """Its evidence, less what all models have in common."""
        return -0.5 * (self.left / temper + self.strain + self.occam)


@dataclass(frozen=True, eq=False)
class Linearised:
    """The data's sum of squares near a point, by body and θ."""

    here: float
    dof: int
    information: Float[np.ndarray, "shared shared"]
    """without any prior"""
    gradient: Float[np.ndarray, " shared"]
    """half of it"""
    theta: Float[np.ndarray, " theta"]
    """here, from where they do nothing"""

    @staticmethod
    def of(tables: Reduced, here: float, dof: int, theta: Float[np.ndarray, " theta"]) -> "Linearised":
        """From the windows' reduced tables at the point."""
        data = Quadratic.of(tables)
        return Linearised(here, dof, data.information, data.gradient, theta)

    def settled(
        self, sd: Float[np.ndarray, " theta"], free: Bool[np.ndarray, " theta"] | None = None
    ) -> tuple[There, float]:
        """The best point with these prior standard deviations, and χ²/dof there (at least 1).

        free: which θ; the others are held where they do nothing.
        """
        every = np.ones(len(self.information), dtype=bool)
        every[BODY:] = True if free is None else free
        temper = max(1.0, self.here / self.dof)
        for _ in range(SETTLING):
            there = self.where(every, sd, temper)
            temper = max(1.0, there.left / self.dof)
        return self.where(every, sd, temper), temper

    def where(self, free: Bool[np.ndarray, " shared"], sd: Float[np.ndarray, " theta"], temper: float) -> There:
        """The best point of these parameters, the body's among them."""
        weight, place = (np.concatenate([np.zeros(BODY), values]) for values in (sd**-2.0, self.theta))
        step = np.where(free, 0.0, -place)
        pull = (self.gradient + self.information @ step) / temper + weight * place
        inner = (self.information / temper + np.diag(weight))[np.ix_(free, free)]
        step[free] = -_solved(inner, pull[free])
        left = max(self.here + float(2 * self.gradient @ step + step @ self.information @ step), 0.0)
        strain = float(weight[free] @ (place + step)[free] ** 2)
        return There(left, strain, _logdet(inner) + 2 * float(np.log(sd[free[BODY:]]).sum()))

    def occam_of_body(self, temper: float) -> float:
        """ln det of the information on the body alone."""
        return _logdet(self.information[:BODY, :BODY] / temper)


def _solved(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Of a positive definite matrix whose columns have units of their own."""
    scale = 1 / np.sqrt(np.diag(matrix))
    return scale * np.linalg.solve(matrix * np.outer(scale, scale), scale * right)


def _logdet(matrix: np.ndarray) -> float:
    scale = np.sqrt(np.diag(matrix))
    return float(np.linalg.slogdet(matrix / np.outer(scale, scale))[1] + 2 * np.log(scale).sum())
