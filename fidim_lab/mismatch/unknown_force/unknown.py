"""Unknown physics: modelled, fitted jointly with the body, and judged on held-out windows.

    found = model_unknown(base, held_out_windows)
    found.words, found.after.chi2_per_dof, found.field, found.parameters

Nothing is chosen by the held-out windows: families are weighed on the fitted ones alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from time import process_time

import numpy as np

from fidim_lab.data.records import PARAMETER_NAMES, Window
from fidim_lab.errors import RefusedError
from fidim_lab.identification.mle.fit import Fit
from fidim_lab.identification.mle.trajectories.likelihood import Likelihood, Simulation
from fidim_lab.identification.mle.trajectories.stages import HORIZONS
from fidim_lab.mismatch.fitting.holdout import HeldOut, predictions
from fidim_lab.mismatch.thresholds import SHARED
from fidim_lab.mismatch.unknown_force.evidence import Evidence, Weighed, weigh_all
from fidim_lab.mismatch.unknown_force.families import families, last_families
from fidim_lab.mismatch.unknown_force.family import Courses, Dependence
from fidim_lab.mismatch.unknown_force.field import Field, field_of
from fidim_lab.mismatch.unknown_force.joint import fitted, near
from fidim_lab.mismatch.unknown_force.latent import LatentForce
from fidim_lab.mismatch.unknown_force.reach import Reach
from fidim_lab.mismatch.unknown_force.responses import responses
from fidim_lab.mismatch.unknown_force.thresholds import UNKNOWN_FORCE
from fidim_lab.mismatch.unknown_force.words import words

MOST_LISTED = 10
"""families of the table"""


@dataclass(frozen=True)
class ParameterShift:
    """One parameter of the body without and with the unknown force."""

    name: str
    without: float
    without_sd: float
    """times √χ²/dof where that is above 1"""
    with_it: float
    with_sd: float


@dataclass(frozen=True)
class FamilyTried:
    """One family that was weighed."""

    label: str
    explained: float
    """share of the excess χ² of the windows looked at"""
    left_out: float
    """the same on windows left out in turn; negative where it does harm"""
    log_evidence: float


@dataclass(frozen=True, eq=False)
class Term:
    """One wrench of the model."""

    label: str
    dependence: Dependence
    cable: int | None
    power: float | None
    shape: tuple[float, ...]
    """a place (m) and the log of a width, a frequency (Hz), a time (s) and the log of a width …: see `families`"""
    words: tuple[str, ...]
    confirmed: bool
    """windows left out in turn agree"""


@dataclass(frozen=True, eq=False)
class UnknownForce:
    """The model found for unknown physics."""

    terms: tuple[Term, ...]
    """empty where no family is believed"""
    explained: float
    """share of the excess χ² that is gone, of the windows as far as the base was fitted to them; 0 … 1"""
    before: HeldOut
    after: HeldOut
    words: tuple[str, ...]
    field: Field | None
    """samples of the wrench along the motion, for pictures"""
    parameters: tuple[ParameterShift, ...]
    tried: tuple[FamilyTried, ...]
    """the best first"""
    fit: Fit
    """of the completed model; the base's own where nothing was found"""
    seconds: float
    """of computing"""

    @property
    def halves(self) -> bool:
        """Whether at least half of what noise does not explain is gone from the held-out windows."""
        return self.after.chi2_per_dof - 1 <= 0.5 * (self.before.chi2_per_dof - 1)


def model_unknown(
    base: Fit, validate: Sequence[Window], *, before: HeldOut | None = None, alone: bool = False
) -> UnknownForce:
    """Find, fit and describe the wrench that a fitted model lacks.

    base: the best model that has names, with rigid cables, of whole recordings, however far it was fitted. validate:
    windows of role `validate`; only their starts are fitted, and nothing is chosen by them. before: what the base says
    of them, where that is known. alone: ask only for one wrench that does nearly all by itself, of the families that
    are weighed quickly.
    Source: Álvarez, Luengo, Lawrence 2009 (latent forces); evidence: see `evidence`.
    Raises RefusedError where cables of the base are springs (then the free directions of acceleration are all six), or
    effects of it have states of their own.
    """
    begin = process_time()
    if base.likelihood.own != 6 + base.likelihood.mechanism.freedoms:
        raise RefusedError("An unknown force is modelled on rigid cables alone; this model has springs or own states.")
    before = predictions(base, validate).figures if before is None else before
    now, latents, chosen, ranking = base, [], [], ()
    whole = left = _excess(base, base)
    for _ in range(1 if alone else UNKNOWN_FORCE.unknown_terms):
        least = SHARED.nearly_all if alone else SHARED.some if latents else -np.inf
        found, tried = _next_term(now, least, late=not alone)
        ranking = ranking or tried
        if found is None:
            break
        completed, latent, weighed = found
        rest = _excess(completed, base)
        if not rest < left:
            break
        left, now, latents, chosen = rest, completed, [*latents, latent], [*chosen, (weighed, tried)]
        if left < SHARED.some * whole or latent.extra_states:
            break
    after = predictions(now, validate).figures if latents else before
    terms = _terms(now, latents, chosen)
    return UnknownForce(
        terms=terms,
        explained=float(np.clip(1 - left / max(whole, 1e-9), 0.0, 1.0)),
        before=before,
        after=after,
        words=tuple(sentence for term in terms for sentence in term.words),
        field=field_of(now, latents) if latents else None,
        parameters=_shifts(base, now),
        tried=_listed(ranking),
        fit=now,
        seconds=process_time() - begin,
    )


def _next_term(
    base: Fit, least: float, late: bool
) -> tuple[tuple[Fit, LatentForce, Weighed] | None, tuple[Weighed, ...]]:
    """The model with one more term, and everything that was weighed; None where nothing is believed.

    least: share of the excess of windows left out. late: whether families that take long may be weighed.
    """
    likelihood, simulation, seconds = _looked_at(base)
    mechanism, shared = likelihood.mechanism, simulation.point.shared
    answers = responses(likelihood, simulation)
    evidence = Evidence(answers, base.prior.rows(shared))
    reach = Reach.of(answers, shared[:3])
    ranking = weigh_all(evidence, [Courses(one, mechanism, shared) for one in families(reach, mechanism.n)])
    first = ranking[0] if ranking else None
    if late and not conclusive(first):
        last = weigh_all(evidence, [Courses(one, mechanism, shared) for one in last_families()])
        ranking = tuple(sorted([*ranking, *last], key=lambda one: -one.left_out))
    best = chosen(ranking)
    if best is None or best.left_out_share < least:
        return None, ranking
    latent = LatentForce.of(best)
    completed = fitted(base, simulation.point, latent, seconds)
    return (None if completed is None else (completed, latent, best)), ranking


def conclusive(first: Weighed | None) -> bool:
    """Whether what foretells windows left out best does nearly all, and the families that take long are spared.

    Of the windows that it is fitted to as well: where the base misses those left out by far more than these, a plain
    force foretells much of that, and yet leaves most of what is there unexplained.
    """
    if first is None or first.family.harmonics:
        return False
    return min(first.explained, first.left_out_share) >= SHARED.nearly_all


def chosen(ranking: Sequence[Weighed]) -> Weighed | None:
    """The most evident of those that predict windows left out well enough; of all where none predicts any.

    Or a plainer one that is as good as it but for what first order leaves out, and predicts windows left out better.
    """
    believed = [one for one in ranking if one.log_evidence > SHARED.enough]
    if not believed:
        return None
    useful = [one for one in believed if one.left_out > 0]
    if not useful:
        return max(believed, key=lambda one: one.log_evidence)
    best = max(one.left_out for one in useful)
    top = max((one for one in useful if one.left_out >= SHARED.some * best), key=lambda one: one.log_evidence)
    as_good = (
        one
        for one in useful
        if one.log_evidence >= (1 - SHARED.slight) * top.log_evidence and one.left_out >= top.left_out
    )
    return min(as_good, key=lambda one: one.effective)


def _looked_at(base: Fit) -> tuple[Likelihood, Simulation, float]:
    """The motion as far as the model follows it, and how far that is (s)."""
    longest = float(base.journey.ends.max())
    best = (base.likelihood, base.journey.optimum.simulation, longest)
    if base.excess < SHARED.near:
        return best
    for seconds in (HORIZONS[2], HORIZONS[1]):
        shorter = near(base, min(seconds, longest))
        if shorter is None:
            continue
        likelihood, journey = shorter
        simulation = journey.optimum.simulation
        rows = sum(len(residual.rows) for residual in simulation.residuals)
        best = (likelihood, simulation, min(seconds, longest))
        if journey.optimum.cost / rows < 10 * SHARED.near * base.noise_ratio**2:
            break
    return best


def _excess(found: Fit, base: Fit) -> float:
    """χ²/dof of markers beyond what the noise explains that the residuals show, as far as `base` is fitted."""
    squares, count = 0.0, 0
    for left, end in zip(found.remainders, base.journey.ends, strict=True):
        near = left.residuals[left.t - left.t[0] <= end + 1e-9]
        squares, count = squares + float(np.nansum(near**2)), count + int(np.isfinite(near).sum())
    return max(0.0, squares / found.likelihood.noise**2 / max(1, count) - max(1.0, found.noise_ratio**2))


def _terms(
    found: Fit, latents: Sequence[LatentForce], picked: Sequence[tuple[Weighed, tuple[Weighed, ...]]]
) -> tuple[Term, ...]:
    terms: list[Term] = []
    for k, (latent, (weighed, ranking)) in enumerate(zip(latents, picked, strict=True)):
        family = weighed.family
        last = len(found.values) - sum(len(later.parameters) for later in latents[k + 1 :])
        theta = found.values[last - len(latent.parameters) : last]
        alone = field_of(found, latents, only=k)
        said = words(latent, theta, alone, [weighed, *(one for one in ranking if one is not weighed)])
        shape = tuple(float(x) for x in latent.shape_at(theta))
        terms.append(
            Term(family.label, family.dependence, family.cable, family.power, shape, said, weighed.left_out > 0)
        )
    return tuple(terms)


def _shifts(base: Fit, found: Fit) -> tuple[ParameterShift, ...]:
    scales = [float(np.sqrt(max(1.0, one.chi2_per_dof))) for one in (base, found)]
    return tuple(
        ParameterShift(
            name,
            float(base.values[k]),
            float(base.sd[k]) * scales[0],
            float(found.values[k]),
            float(found.sd[k]) * scales[1],
        )
        for k, name in enumerate(PARAMETER_NAMES)
    )


def _listed(ranking: Sequence[Weighed]) -> tuple[FamilyTried, ...]:
    return tuple(
        FamilyTried(one.family.label, one.explained, one.left_out_share, one.log_evidence)
        for one in ranking[:MOST_LISTED]
    )
