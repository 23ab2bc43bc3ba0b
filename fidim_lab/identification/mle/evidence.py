"""The evidence for open geometry against exact geometry.

Evidence is Laplace's: half the fall of the sum of squares, prior included, less the Occam factor
½ ln det(I + prior covariance × information). Where the model misses more than noise (χ²/dof above 1) residuals are no
independent samples: the data's part of both is divided by χ²/dof. All from one linearised problem, at a point where
cables, markers and the capture's frame are open; each is closed, and its standard deviations are scaled, within it.

`Linearised` is that problem: the sum of squares near an optimum as a quadratic function, with a normal prior about 0 on
all but the body, and the evidence of models that free some of it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float
from scipy.stats import norm

from fidim_lab.identification.mle.fit import Fit
from fidim_lab.identification.mle.spread import Quadratic
from fidim_lab.identification.mle.trajectories.normal import Reduced
from fidim_lab.identification.survey import Nuisance, prior_sd
from fidim_lab.model.sensitivity.equations import BODY

SETTLING = 4
"""rounds in which χ²/dof and the best point agree to a thousandth"""

ODDS = 3.0
"""nats of evidence (odds of 20) by which either of the two must lead before the file's geometry is called exact or
not; between them the geometry is left open, which only widens the standard deviations"""
FACTORS = np.geomspace(0.1, 30.0, 50)
"""times a usual survey: what robot files are off by, from a tenth of a millimetre to three centimetres"""
SPREAD_OF_FACTORS = np.log(3.0)
"""standard deviation of the factor's logarithm about 0, before any data: two of three surveys are within a factor 3"""
SAME = 1.3
"""factors nearer than this change standard deviations by less than the spread of 24 draws tells"""
TAIL = 3.0
"""sd within which an answer is to be right: what lies beyond as often as by a normal distribution is told as its sd"""
FRAME = ("frame", "gravity")
"""pieces of the geometry that are those of the capture's frame"""
COARSE = 4
"""step through `FACTORS` where two of them are sought: 0.47 of a logarithm; the best of them is within `SAME`"""


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


@dataclass(frozen=True)
class Factors:
    """Times a usual survey; None for what counts as exact."""

    cables: float | None
    """anchors and attachments"""
    markers: float | None
    frame: float | None = None
    """the capture's frame, and the direction of gravity in it"""

    @property
    def exact(self) -> bool:
        """Whether the whole geometry counts as exact."""
        return self.cables is None and self.markers is None and self.frame is None

    def near(self, other: "Factors") -> bool:
        """Whether the same is open, and about as wide."""
        pairs = ((self.cables, other.cables), (self.markers, other.markers), (self.frame, other.frame))
        return all(a is b is None or (a is not None and b is not None and 1 / SAME < a / b < SAME) for a, b in pairs)


ALL_EXACT = Factors(None, None)


@dataclass(frozen=True)
class GeometryOdds:
    """An open geometry against the exact one."""

    factors: Factors = ALL_EXACT
    """what is left open, and how wide"""
    log_bayes: float | None = None
    """nats by which it leads, averaged over the factors' prior; of what was tried where all counts as exact; None where
    the survey is stated"""
    chi2_gain: float = 0.0
    """fall of the sum of squares over χ²/dof of the open geometry; 0 where none was tried"""

    @property
    def leads(self) -> bool:
        """Whether the open geometry is the better one."""
        return self.log_bayes is not None and self.log_bayes >= ODDS


NOT_WEIGHED = GeometryOdds()
"""the survey is stated"""


def weighed(exact: Fit, found: Fit, opened: Sequence[Nuisance]) -> GeometryOdds:
    """From the linearised problem at a fit with cables and markers open, perhaps the frame too, in the order of its θ.

    Cables or markers count as exact where the evidence for that leads by `ODDS`, whatever of the other is open; the
    frame counts as exact unless the evidence against that leads by as much.
    """
    dof = sum(left.dof for left in found.remainders)
    problem = Linearised.of(found.tables, _cost(found), dof, found.values[BODY:])
    of_markers = np.concatenate([np.full(len(one.sd), one.what == "marker") for one in opened])
    of_frame = np.concatenate([np.full(len(one.sd), one.what in FRAME) for one in opened])
    cables, markers = ~(of_markers | of_frame), of_markers
    tried = _Tried(problem, _cost(exact), prior_sd(opened))
    by_cables, by_markers, by_both = tried.of(cables), tried.of(markers), tried.of_both(cables, markers)
    exact_cables = max(0.0, by_markers.log_bayes) - max(by_cables.log_bayes, by_both.log_bayes) > ODDS
    exact_markers = max(0.0, by_cables.log_bayes) - max(by_markers.log_bayes, by_both.log_bayes) > ODDS
    best = by_both
    if exact_markers:
        best = by_cables
    elif exact_cables:
        best = by_markers
    open_cables, open_markers = best.factors
    factors = Factors(None if exact_cables else open_cables, None if exact_markers else open_markers)
    odds = GeometryOdds(factors, best.log_bayes, best.gain)
    return tried.with_frame(odds, cables, markers, of_frame) if of_frame.any() else odds


def fall(exact: Fit, found: Fit) -> float:
    """Of the sum of squares, over χ²/dof of the second fit: what was reached of `GeometryOdds.chi2_gain`."""
    dof = sum(left.dof for left in found.remainders)
    return (_cost(exact) - _cost(found)) / max(1.0, _cost(found) / dof)


def over_factors(evidences: Float[np.ndarray, " F"]) -> tuple[float, int]:
    """Evidence averaged over the prior of `FACTORS`, and which of them is the most likely."""
    return _averaged(evidences, _prior(FACTORS))


@dataclass(frozen=True)
class _One:
    """What some of the geometry brings."""

    log_bayes: float
    factors: tuple[float, float]
    """of cables and markers: as wide as the recordings allow"""
    gain: float


@dataclass(frozen=True, eq=False)
class _Tried:
    """The linearised problem, and what an exact geometry leaves."""

    problem: Linearised
    before: float
    survey: Float[np.ndarray, " theta"]
    beside: Bool[np.ndarray, " theta"] | None = None
    """what is open in every case, as wide as `survey` has it"""

    def of(self, free: Bool[np.ndarray, " theta"]) -> _One:
        """One of the two by one factor."""
        found = [self._at(factor * self.survey, free) for factor in FACTORS]
        evidences = np.array([evidence for evidence, _ in found])
        log_bayes, best = over_factors(evidences)
        factor = float(FACTORS[best]) if log_bayes < ODDS else as_wide(evidences + _prior(FACTORS), FACTORS)
        return _One(log_bayes, (factor, factor), found[best][1])

    def of_both(self, one: Bool[np.ndarray, " theta"], other: Bool[np.ndarray, " theta"]) -> _One:
        """Both, each by its own."""
        grid = FACTORS[::COARSE]
        every = one | other
        pairs = [(a, b) for a in grid for b in grid]
        found = [self._at(np.where(one, a, b) * self.survey, every) for a, b in pairs]
        prior = (_prior(grid)[:, np.newaxis] + _prior(grid)).ravel()
        evidences = np.array([evidence for evidence, _ in found])
        log_bayes, best = _averaged(evidences, prior)
        if log_bayes < ODDS:
            return _One(log_bayes, pairs[best], found[best][1])
        odds = (evidences + prior).reshape(len(grid), len(grid))
        wide = tuple(as_wide(np.logaddexp.reduce(odds, axis=axis), grid) for axis in (1, 0))
        return _One(log_bayes, (wide[0], wide[1]), found[best][1])

    def with_frame(
        self,
        odds: GeometryOdds,
        cables: Bool[np.ndarray, " theta"],
        markers: Bool[np.ndarray, " theta"],
        frame: Bool[np.ndarray, " theta"],
    ) -> GeometryOdds:
        """The same, or the odds with the frame open as well, where these lead by `ODDS`; cables may then be exact."""
        wide = odds.factors.markers
        also = markers if odds.leads and wide is not None else np.zeros_like(markers)
        held = replace(self, survey=np.where(also, (wide or 1.0) * self.survey, self.survey), beside=also)
        alone, both = held.of(frame), held.of_both(cables, frame)
        if max(alone.log_bayes, both.log_bayes) - max(0.0, odds.log_bayes or 0.0) < ODDS:
            return odds
        open_markers = wide if also.any() else None
        if alone.log_bayes - both.log_bayes > ODDS:
            return GeometryOdds(Factors(None, open_markers, alone.factors[0]), alone.log_bayes, alone.gain)
        return GeometryOdds(Factors(both.factors[0], open_markers, both.factors[1]), both.log_bayes, both.gain)

    def _at(self, sd: Float[np.ndarray, " theta"], free: Bool[np.ndarray, " theta"]) -> tuple[float, float]:
        """Evidence with these standard deviations, and the fall of the sum of squares."""
        if self.beside is not None:
            sd, free = np.where(self.beside, self.survey, sd), free | self.beside
        there, temper = self.problem.settled(sd, free)
        gain = (self.before - there.left) / temper
        return 0.5 * (gain - there.strain - there.occam + self.problem.occam_of_body(temper)), gain


def as_wide(odds: Float[np.ndarray, " F"], factors: Float[np.ndarray, " F"]) -> float:
    """The factor whose normal distribution has as much beyond `TAIL` of its sd as all factors together, by their odds.

    Few pieces that are seen tell the factor of the others badly: of two, it is three times what the likeliest one is.
    odds: logarithms, up to a constant.
    """
    weights = np.exp(odds - np.logaddexp.reduce(odds))
    places = np.geomspace(factors[0], factors[-1], 400)
    beyond = norm.sf(TAIL * places[:, np.newaxis] / factors) @ weights
    return float(np.interp(-norm.sf(TAIL), -beyond, places))


def _prior(factors: Float[np.ndarray, " F"]) -> Float[np.ndarray, " F"]:
    return -0.5 * (np.log(factors) / SPREAD_OF_FACTORS) ** 2


def _averaged(evidences: Float[np.ndarray, " F"], prior: Float[np.ndarray, " F"]) -> tuple[float, int]:
    average = float(np.logaddexp.reduce(evidences + prior) - np.logaddexp.reduce(prior))
    return average, int(np.argmax(evidences + prior))


def _cost(found: Fit) -> float:
    """Of markers, lengths and the windows' own priors: what the shared parameters' prior adds is counted apart."""
    return found.journey.optimum.simulation.cost


def _solved(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Of a positive definite matrix whose columns have units of their own."""
    scale = 1 / np.sqrt(np.diag(matrix))
    return scale * np.linalg.solve(matrix * np.outer(scale, scale), scale * right)


def _logdet(matrix: np.ndarray) -> float:
    scale = np.sqrt(np.diag(matrix))
    return float(np.linalg.slogdet(matrix / np.outer(scale, scale))[1] + 2 * np.log(scale).sum())
