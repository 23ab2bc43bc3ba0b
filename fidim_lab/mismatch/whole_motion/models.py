"""Models fitted to whole windows, with their predictions of held-out windows and their evidence.

Evidence is Laplace's: half the data's sum of squares over `temper`, the prior's strain, and the Occam factor
½ ln det(I + prior covariance × information / temper). `temper` is the sum of squares for each independent value of what
the best model leaves: 1 for white noise of the stated size, far above χ²/dof where the residual is a slow wave.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fidim_lab.effects.effect import NamedEffect
from fidim_lab.errors import RefusedError
from fidim_lab.identification.mle.fit import Fit
from fidim_lab.identification.mle.held_out import predict_all
from fidim_lab.identification.mle.judge import Remainder
from fidim_lab.identification.mle.spread import Quadratic
from fidim_lab.identification.mle.trajectories.optimise import FINAL, ON_THE_WAY, Effort
from fidim_lab.identification.mle.trajectories.recordings import FollowedSamples
from fidim_lab.identification.mle.warm_start import Newcomer, rearranged
from fidim_lab.identification.survey import Nuisance, prior_sd
from fidim_lab.mismatch.fitting.refit import prior_of
from fidim_lab.mismatch.linearised.hypotheses import Hypothesis
from fidim_lab.mismatch.thresholds import SHARED
from fidim_lab.mismatch.whole_motion.common_part import CommonPart
from fidim_lab.mismatch.whole_motion.independent_values import independent_values
from fidim_lab.model.sensitivity.equations import BODY
from fidim_lab.model.slots import Effect

TRIED = replace(ON_THE_WAY, rounds=15, crawl=SHARED.crawl)
"""until a round takes less than a hundredth of what is left: of some hundred independent values half a nat"""


@dataclass(frozen=True, eq=False)
class WholeModel:
    """Some terms, and a geometry that is open or exact, fitted to whole windows."""

    common: CommonPart
    terms: tuple[Hypothesis, ...]
    geometry: tuple[Nuisance, ...]
    """what is open, under its prior; empty where the robot file's counts as exact"""
    found: Fit
    predict: Callable[[Fit], dict[str, Remainder]]

    @cached_property
    def held(self) -> dict[str, Remainder]:
        """Held-out window → what is left of it; those that could be predicted. Takes longer than a fit."""
        return self.predict(self.found)

    def theta_of(self, k: int) -> np.ndarray:
        """θ of term k."""
        return self.found.values[self.found.place_of(self.terms[k].effect)]

    @property
    def is_predicted(self) -> bool:
        """Whether held-out windows were asked."""
        return "held" in self.__dict__

    @property
    def label(self) -> str:
        """For people."""
        names = [h.label for h in self.terms] + (["open geometry"] if self.geometry else [])
        return " + ".join(names) or "nothing"

    @property
    def size(self) -> int:
        """Terms, an open geometry among them."""
        return len(self.terms) + bool(self.geometry)

    @property
    def parameters(self) -> int:
        """Of its terms and geometry."""
        return len(self.found.values) - BODY

    @property
    def held_out(self) -> float:
        """m rms over held-out windows; nan without any."""
        return float(np.sqrt(np.mean([one.rms**2 for one in self.held.values()]))) if self.held else float("nan")

    @property
    def fitted(self) -> float:
        """m rms over fitted windows."""
        return float(np.sqrt(np.mean([one.rms**2 for one in self.found.remainders])))

    @property
    def chi2_per_dof(self) -> float:
        """Of held-out windows, by the stated noise; nan without any."""
        dof = sum(one.dof for one in self.held.values())
        return sum(one.chi2 for one in self.held.values()) / dof / self.common.noise if dof else float("nan")

    @cached_property
    def prior_sd(self) -> np.ndarray:
        """Of all θ before any data: of what every model contains, of its terms, of its geometry."""
        return np.concatenate([self.common.nuisance_sd, prior_of(self.terms), prior_sd(self.geometry)])

    @property
    def cost(self) -> float:
        """Sum of squares of fitted windows, by the noise that they were fitted with."""
        return self.found.journey.optimum.simulation.cost

    @cached_property
    def quadratic(self) -> Quadratic:
        """The data's sum of squares near the optimum; asked for with every comparison."""
        return Quadratic.of(self.found.tables)

    @cached_property
    def temper(self) -> float:
        """Sum of squares for each independent value of what is left, at least that of the stated noise."""
        values = sum(independent_values(one.residuals) for one in self.found.remainders)
        return max(self.common.noise, self.cost / values)

    def nats(self, temper: float) -> float:
        """Evidence, less what all models of these windows have in common."""
        found = self.found
        information = self.quadratic.information / temper
        low, high = found.prior.bounds
        free = (found.values > low) & (found.values < high)
        weight = np.concatenate([np.zeros(BODY), self.prior_sd**-2.0])
        scale = np.concatenate([np.ones(BODY), self.prior_sd])[free]
        inner = (information + np.diag(weight))[np.ix_(free, free)] * np.outer(scale, scale)
        strain = float((weight * (found.values - found.prior.mean) ** 2).sum())
        size = np.sqrt(np.diag(inner))
        occam = float(np.linalg.slogdet(inner / np.outer(size, size))[1] + 2 * np.log(size).sum())
        chosen = sum(h.choice for h in self.terms)
        return -0.5 * (self.cost / temper + strain + occam) - chosen

    def sd(self, temper: float) -> np.ndarray:
        """Standard deviations of all shared parameters that count what is left as it is."""
        prior = np.diag(np.concatenate([self.found.prior.sd[:BODY], self.prior_sd]) ** -2.0)
        data = self.quadratic
        return np.sqrt(np.diag(Quadratic(data.information / temper + prior, data.gradient).covariance))


@dataclass(frozen=True, eq=False)
class ModelFits:
    """Fits models to the same windows, each from the optimum of another one."""

    common: CommonPart
    recordings: tuple[FollowedSamples, ...]
    """held out"""

    @property
    def as_it_is(self) -> WholeModel:
        """The model without any term."""
        return WholeModel(self.common, (), (), self.common.found, self.predicted)

    def with_term(self, model: WholeModel, new: Hypothesis, theta: np.ndarray) -> WholeModel | None:
        """With one more term, from these θ; None where it gets nowhere."""
        return self._fitted(model, (*model.terms, new), model.geometry, {new: theta})

    def instead(self, model: WholeModel, k: int, new: Hypothesis, theta: np.ndarray) -> WholeModel | None:
        """With another term in the place of term k, from these θ."""
        terms = (*model.terms[:k], new, *model.terms[k + 1 :])
        return self._fitted(model, terms, model.geometry, {new: theta})

    def without(self, model: WholeModel, k: int) -> WholeModel | None:
        """Without term k."""
        return self._fitted(model, (*model.terms[:k], *model.terms[k + 1 :]), model.geometry, {})

    def opened(self, model: WholeModel, geometry: tuple[Nuisance, ...]) -> WholeModel | None:
        """With this geometry open."""
        return self._fitted(model, model.terms, geometry, {})

    def closed(self, model: WholeModel) -> WholeModel | None:
        """With the geometry of the robot file."""
        return self._fitted(model, model.terms, (), {})

    def finished(self, model: WholeModel) -> WholeModel:
        """The same at its optimum, to a hundredth of a standard deviation: the best that is found from all beginnings.

        A model without what dissipates bends the body, and a model that is begun there may stay bent.
        """
        fresh = {h: model.theta_of(k)[list(h.scored)] for k, h in enumerate(model.terms)}
        every = [self._fitted(model, model.terms, model.geometry, {}, FINAL)]
        every += [self._fitted(model, model.terms, model.geometry, fresh, FINAL, one) for one in self.common.elsewhere]
        reached = [one for one in every if one is not None]
        return max(reached, key=lambda one: one.nats(model.temper), default=model)

    def _fitted(
        self,
        donor: WholeModel,
        terms: tuple[Hypothesis, ...],
        geometry: tuple[Nuisance, ...],
        fresh: dict[Hypothesis, np.ndarray],
        effort: Effort = TRIED,
        elsewhere: Fit | None = None,
    ) -> WholeModel | None:
        """Each θ from where the donor has it, or from a fresh one. Priors count as they do beside tempered data.

        elsewhere: from where everything begins instead that is not fresh.
        """
        begin = elsewhere or donor.found
        known, softened = begin.likelihood.mechanism.effects, np.sqrt(donor.temper)

        def part(effect: NamedEffect, sd: np.ndarray, mean: np.ndarray, begun: np.ndarray | None = None) -> Newcomer:
            wide = np.full(len(mean), np.inf)
            low, high = (-wide, wide) if effect in offsets else effect.bounds(self.common.context)
            if begun is None:
                begun = begin.values[begin.place_of(effect)] if effect in known else mean
            parts = (np.clip(begun, low, high), sd / softened, low, high, mean)
            return Newcomer(effect, *(one.tolist() for one in parts))

        offsets = {one.effect for one in geometry}
        wanted: list[Effect | Newcomer] = [*self.common.nuisances]
        wanted += [part(h.effect, prior_of([h]), h.absent, h.theta(fresh[h]) if h in fresh else None) for h in terms]
        wanted += [part(one.effect, np.array(one.sd), np.zeros(len(one.sd))) for one in geometry]
        found = rearranged(begin, wanted, effort)
        return None if found is None else WholeModel(self.common, terms, geometry, found, self.predicted)

    def predicted(self, found: Fit) -> dict[str, Remainder]:
        """The residuals of held-out windows, without those that the fit cannot follow."""
        mechanism = found.likelihood.mechanism
        predicted = predict_all(mechanism, found.values, self.recordings, mechanism.robot.sensors)
        pairs = zip(self.recordings, predicted, strict=True)
        return {r.window.id: one.remainder for r, one in pairs if not isinstance(one, RefusedError) and not one.lost}
