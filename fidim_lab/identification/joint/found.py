"""A joint fit and everything that is known about it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from fidim_lab.data.records import Body
from fidim_lab.effects.effect import NamedEffect
from fidim_lab.identification.equations.uncertainty import jackknife_sd
from fidim_lab.identification.joint.members import JointMember, Layout
from fidim_lab.identification.joint.search import JointOptimum
from fidim_lab.identification.mle import spread
from fidim_lab.identification.mle.evidence import ODDS, Linearised
from fidim_lab.identification.mle.findings import MISFIT
from fidim_lab.identification.mle.judge import Remainder
from fidim_lab.identification.mle.trajectories.normal import Prior, reduced
from fidim_lab.model.sensitivity.equations import BODY

NEAR = 0.3
"""of its stated standard deviation, by which no parameter of the body is still to move"""


@dataclass(frozen=True, eq=False)
class JointFit:
    """An optimum of several campaigns and everything that is known about it."""

    chosen: tuple[int, ...]
    """which of the campaigns"""
    layout: Layout
    members: tuple[JointMember, ...]
    optimum: JointOptimum
    start: Body
    prior: Prior
    factor: float
    """times a usual survey, where no file states one"""
    remainders: tuple[tuple[Remainder, ...], ...]

    @property
    def values(self) -> Float[np.ndarray, " shared"]:
        """The joint parameters."""
        return self.optimum.shared

    @property
    def body(self) -> Body:
        """The identified body."""
        return Body.from_vector(self.values[:BODY])

    @property
    def theta(self) -> Float[np.ndarray, " dissipating"]:
        """Of what dissipates."""
        return self.values[BODY : BODY + self.layout.dissipating]

    @property
    def dof(self) -> int:
        """Numbers compared less unknowns."""
        return sum(left.dof for of_one in self.remainders for left in of_one) - len(self.values)

    @property
    def chi2_per_dof(self) -> float:
        """Of all markers and lengths that were used."""
        return sum(left.chi2 for of_one in self.remainders for left in of_one) / max(1, self.dof)

    @property
    def noise_ratio(self) -> float:
        """Marker noise by fourth differences of the residuals over the stated one; 1 where that cannot be told."""
        each = zip(self.members, self.remainders, strict=True)
        seen = [x.noise / m.likelihood.noise for m, of_one in each for x in of_one if x.noise is not None]
        return float(np.median(seen)) if seen else 1.0

    @property
    def excess(self) -> float:
        """χ²/dof for the noise that the residuals show."""
        return self.chi2_per_dof / self.noise_ratio**2

    @property
    def explained(self) -> bool:
        """Whether what is left is near noise: how much of it counts is said by the worth of each window."""
        return self.excess < MISFIT

    @property
    def tables(self) -> Float[np.ndarray, "W s s"]:
        """The windows' reduced tables at the optimum, by the joint parameters; alike in shape for all windows."""
        found: list[np.ndarray] = []
        for part in self.optimum.parts(self.members, self.layout):
            local = reduced(part.tables, part.own)
            wide = part.spread(local, self.layout.size)
            padded = np.zeros((len(wide), self.layout.size + 1, self.layout.size + 1))
            padded[:, : wide.shape[1]] = wide
            found.append(padded)
        return np.concatenate(found)

    @property
    def prior_rows(self) -> Float[np.ndarray, "shared s"]:
        """The prior at the optimum."""
        return self.prior.rows(self.values)

    @property
    def tempered_tables(self) -> Float[np.ndarray, "W s s"]:
        """`tables`: each window's squares are over its χ²/dof already."""
        return self.tables

    @property
    def tempered_covariance(self) -> Float[np.ndarray, "shared shared"]:
        """The information to rely on: each window's over its χ²/dof, with the survey."""
        return spread.Quadratic.of(self.tables, self.prior_rows).covariance

    @property
    def asked_for(self) -> tuple[NamedEffect, ...]:
        """What dissipates, without what the evidence can do without: one after the other, the least needed first.

        A parameter at its bound does nothing: it is held there, for past it the linearised problem would go on gaining.
        """
        problem, sd = self.linearised(), self.prior_sd(self.factor)
        idle = np.zeros(self.layout.size, dtype=bool)
        idle[BODY : BODY + self.layout.dissipating] = self.theta <= 0.0
        kept = [place for place in self.layout.of_effects if not idle[place].all()]

        def nats(places: Sequence[slice]) -> float:
            free = np.ones(self.layout.size, dtype=bool)
            free[BODY : BODY + self.layout.dissipating] = False
            for place in places:
                free[place] = ~idle[place]
            return problem.where(free, sd, 1.0).nats(1.0)

        while kept:
            every = nats(kept)
            needs = [every - nats([other for other in kept if other is not place]) for place in kept]
            if min(needs) > ODDS:
                break
            kept.pop(int(np.argmin(needs)))
        each = zip(self.layout.effects, self.layout.of_effects, strict=True)
        return tuple(effect for effect, place in each if place in kept)

    @property
    def settled(self) -> bool:
        """Whether nothing better is near."""
        if self.optimum.ending.settled or self.optimum.promise < 1.0:
            return True
        replicates = spread.leave_one_out(self.tables, self.prior_rows, self.values)
        if self.explained or replicates is None:
            return False
        sd = np.maximum(jackknife_sd(replicates), np.sqrt(np.diag(self.tempered_covariance)))
        return bool((np.abs(self.without(np.zeros(len(sd), dtype=bool)) - self.values) < NEAR * sd)[:BODY].all())

    @property
    def chi2_gain(self) -> float:
        """By how much the sum of squares falls with the open geometry, to first order, in units of χ²/dof."""
        problem = self.linearised()
        fixed = np.arange(self.layout.size) < BODY + self.layout.dissipating
        return max(0.0, problem.where(fixed, self.prior_sd(self.factor), 1.0).left - problem.here)

    def without(self, dropped: Float[np.ndarray, " shared"]) -> Float[np.ndarray, " shared"]:
        """The estimate with the parameters marked in `dropped` (bool) set to zero, to first order."""
        free = ~np.asarray(dropped, dtype=bool)
        return self.values + spread.Quadratic.of(self.tables, self.prior_rows).step(free, -self.values)

    def linearised(self) -> Linearised:
        """The data's sum of squares near the optimum."""
        return Linearised.of(self.tables, self.optimum.data_cost, max(1, self.dof), self.values[BODY:])

    def prior_sd(self, factor: float) -> Float[np.ndarray, " theta"]:
        """Of what dissipates, and of the geometry at so many times a usual survey."""
        dissipating = self.prior.sd[BODY : BODY + self.layout.dissipating]
        return np.concatenate([dissipating, self.layout.survey(factor)])
