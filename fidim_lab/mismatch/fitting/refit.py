"""Fit a completed model: body, every window's start, and the parameters of the effects within their bounds."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float

from fidim_lab.effects.plausibility import Context
from fidim_lab.identification.mle.fit import Fit
from fidim_lab.identification.mle.starts.springs import stretches
from fidim_lab.identification.mle.trajectories.likelihood import Point
from fidim_lab.mismatch.fitting.fit_data import Ground, settle
from fidim_lab.mismatch.fitting.sprung import are_stiff, begins_anew, stiffest
from fidim_lab.mismatch.linearised.hypotheses import Hypothesis
from fidim_lab.mismatch.residuals.residual import Leftover, of_remainders
from fidim_lab.mismatch.residuals.whiteness import whiteness
from fidim_lab.mismatch.thresholds import SHARED
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion import extra_count
from fidim_lab.model.sensitivity.equations import BODY, sprung
from fidim_lab.model.sensitivity.starts import tied


@dataclass(frozen=True, eq=False)
class Completed:
    """A fitted model with some effects (none: the model as it is)."""

    tried: tuple[Hypothesis, ...]
    fit: Fit
    whole: bool
    """fitted to whole windows, not to their first seconds only"""
    at_bound: tuple[bool, ...] = field(default=())
    """of each entry of the terms' θ: held at a bound"""

    @property
    def mechanism(self) -> Mechanism:
        """With the effects."""
        return self.fit.likelihood.mechanism

    @property
    def excess(self) -> float:
        """χ²/dof for the noise that the residuals show."""
        return self.fit.excess

    @property
    def chi2(self) -> float:
        """Sum of squares of markers and lengths."""
        return sum(left.chi2 for left in self.fit.remainders)

    @property
    def strain(self) -> float:
        """Sum of squares by which the geometry is off its survey; 0 where that is exact."""
        behind = slice(BODY + sum(len(h.effect.parameters) for h in self.tried), None)
        prior, values = self.fit.prior, self.fit.values
        return float((((values - prior.mean) / prior.sd)[behind] ** 2).sum())

    @property
    def dof(self) -> int:
        """Less where windows were lost, or end because a cable goes slack."""
        return sum(left.dof for left in self.fit.remainders)

    @property
    def free(self) -> Bool[np.ndarray, " shared"]:
        """Which shared parameters the fit could move: all that are not at a bound."""
        free = np.ones(len(self.fit.values), dtype=bool)
        free[BODY : BODY + len(self.at_bound)] = ~np.array(self.at_bound, dtype=bool)
        return free

    @property
    def leftovers(self) -> tuple[Leftover, ...]:
        """The residual of each window."""
        return of_remainders(self.fit)

    @cached_property
    def is_white(self) -> bool:
        """Whether nothing but noise is left of what it was fitted to."""
        return whiteness(self.leftovers).is_white

    @property
    def label(self) -> str:
        """For people."""
        return " + ".join(h.label for h in self.tried) or "nothing"

    def theta_of(self, k: int) -> tuple[np.ndarray, np.ndarray]:
        """θ of effect k with its standard deviations (nan where held).

        The phases of all windows may turn together if a wave turns back: its sd are those with their mean phase held.
        """
        place, covariance = self.place_of(k), self.fit.covariance
        if self.tried[k].effect.of_each_window:
            scored = place.start + np.array(self.tried[k].scored)
            s, c = np.split(self.fit.values[scored], 2)
            covariance = _held_along(covariance, scored, np.concatenate([-c, s]))
        sd = np.sqrt(np.diag(covariance))[place]
        sd[np.array(self.at_bound, dtype=bool)[place.start - BODY : place.stop - BODY]] = np.nan
        return self.fit.values[place], sd

    def size_in_sd(self, k: int) -> float:
        """How far the amplitudes of effect k, those parameters that have a score, are from 0 together (Wald).

        Their covariance counts all that is uncertain beside them, by what the residuals say of the noise.
        """
        first = self.place_of(k).start
        amplitudes = [first + j for j, scanned in enumerate(self.tried[k].effect.scanned) if not scanned]
        values = self.fit.values[amplitudes]
        covariance = self.fit.covariance[np.ix_(amplitudes, amplitudes)] * max(1.0, self.fit.chi2_per_dof)
        return float(np.sqrt(values @ np.linalg.lstsq(covariance, values, rcond=None)[0]))

    @property
    def has_open_geometry(self) -> bool:
        """Whether the robot file's geometry is fitted with the effects, under a survey."""
        return len(self.mechanism.effects) > len(self.tried)

    @property
    def at_an_edge(self) -> bool:
        """Whether a parameter is held at a bound other than 0."""
        theta = self.fit.values[BODY : BODY + len(self.at_bound)]
        return bool((np.array(self.at_bound, dtype=bool) & (theta != 0.0)).any())

    @property
    def thetas(self) -> list[np.ndarray]:
        """θ of each effect: where a fit of a model with the same effects may begin."""
        return [self.fit.values[self.place_of(k)] for k in range(len(self.tried))]

    def place_of(self, k: int) -> slice:
        """Where θ of effect k stands among the shared parameters."""
        first = BODY + sum(len(h.effect.parameters) for h in self.tried[:k])
        return slice(first, first + len(self.tried[k].effect.parameters))

    def freedom(self, scale: float) -> float:
        """What the effects' freedom costs, in nats (Laplace): ln of prior over posterior volume, and of cables.

        Of the volume and not of each parameter's own spread: two terms of which only the sum is told have spreads as
        wide as before any data, and would cost nothing. A direction of which nothing is told costs nothing.
        """
        if not self.tried:
            return 0.0
        wide = prior_of(self.tried)
        ours = slice(BODY, BODY + len(wide))
        told = self.fit.covariance[ours, ours] * scale / np.outer(wide, wide)
        shares = np.linalg.eigvalsh(told) if np.isfinite(told).all() else np.ones(1)
        return float(-0.5 * np.log(np.clip(shares, 1e-300, 1.0)).sum()) + sum(h.choice for h in self.tried)


def evidence(model: Completed, than: Completed, scale: float) -> float:
    """Log-evidence of one model over another of the same windows: half the χ² gained less what freedom costs.

    Less, too, what the geometry's survey is strained more: what only a wrong geometry explains has its price.
    scale: χ²/dof that counts as noise, the same for all that are compared. A model that loses data which the other
    follows is charged for them as for the rest.
    """
    most = max(model.dof, than.dof)
    gained = than.chi2 * most / max(1, than.dof) - model.chi2 * most / max(1, model.dof)
    strained = 0.5 * (model.strain - than.strain)
    return 0.5 * gained / scale - strained - model.freedom(scale) + than.freedom(scale)


def refit(
    ground: Ground,
    donor: Fit,
    tried: Sequence[Hypothesis],
    starts: Sequence[Float[np.ndarray, " theta"]],
    context: Context,
    *,
    ringing: bool = False,
    phases: Float[np.ndarray, " W"] | None = None,
    simpler: Completed | None = None,
    rival: Completed | None = None,
) -> Completed | None:
    """Fit the model with these effects from these θ; None where it does not get there.

    donor: the fit whose body and states are the start. Bounds hold inside the fit: what would cross one is held on it.
    ringing: the oscillations of stiff cables are followed too, which begin where the platform is let go.
    phases: of the last effect in each window (rad), where it has such as its one extra state.
    simpler: a model of which this one is a wider form: a fit that will hardly get as far is given up. rival: one of
    the same recordings, and likewise.
    """
    wanted = np.inf if simpler is None else _cost(simpler, ground)
    wanted = wanted if rival is None else min(wanted, rival.fit.journey.optimum.cost)
    mechanism = _mechanism(ground, donor, tried, starts, ringing)
    prior = ground.prior(
        np.concatenate([np.zeros(0), *(h.absent for h in tried)]),
        prior_of(tried),
    )
    ours = slice(BODY, BODY + sum(len(h.effect.parameters) for h in tried))
    low, high = _bounds(tried, context)
    if mechanism.springs:
        low = np.maximum(low, stiffest(mechanism)[: len(low)])
    surveyed = _geometry_of(donor, ground)
    shared = np.concatenate([donor.values[:BODY], np.clip(mechanism.theta[: len(low)], low, high), surveyed])
    free = np.ones(len(shared), dtype=bool)
    states = donor.journey.optimum.point.states
    if begins_anew(mechanism, donor) or not mechanism.springs:
        states = replace(states, tensions=None)
    if phases is not None and len(phases) == len(states.positions):
        others = np.zeros((len(phases), extra_count(mechanism) - 1)) if states.astray is None else states.astray
        states = replace(states, astray=np.column_stack([others, phases]))
    for _ in range(SHARED.rounds):
        start = Point(shared, tied(mechanism, shared, states, ground.likelihood.begins))
        found = settle(ground, donor, mechanism, start, prior, free, wanted)
        if found is None:
            return None
        theta = found.values[ours]
        outside = (theta < low) | (theta > high)
        if not outside.any():
            return Completed(tuple(tried), found, ground.whole, tuple((~free[ours]).tolist()))
        free[ours] &= ~outside
        shared = np.concatenate([found.values[:BODY], np.clip(theta, low, high), found.values[ours.stop :]])
        states = found.journey.optimum.point.states
    return None


def again(ground: Ground, donor: Fit, known: Completed, context: Context) -> Completed | None:
    """A known model fitted to other recordings, from their fit by another one; None where it does not get there."""
    return refit(ground, donor, known.tried, known.thetas, context, phases=_phases_of(known, donor))


def _phases_of(known: Completed, donor: Fit) -> Float[np.ndarray, " W"] | None:
    """Of the last effect in the recordings of another fit: what is known by their ids, 0 where nothing is."""
    astray = known.fit.journey.optimum.point.states.astray
    if astray is None or not known.tried or not known.tried[-1].effect.of_each_window:
        return None
    found = dict(zip((one.window.id for one in known.fit.likelihood.recordings), astray[:, -1], strict=True))
    return np.array([found.get(one.window.id, 0.0) for one in donor.likelihood.recordings])


def _cost(model: Completed, ground: Ground) -> float:
    """Sum of squares that a wider form must beat; infinite where it is not of the same recordings to their ends."""
    journey = model.fit.journey
    whole = model.whole and ground.whole and not (journey.lost or journey.slack)
    return journey.optimum.cost if whole else np.inf


def _mechanism(
    ground: Ground, donor: Fit, tried: Sequence[Hypothesis], starts: Sequence[np.ndarray], ringing: bool
) -> Mechanism:
    """The model with the effects; cables that stretch are springs, quiet ones where they are stiff."""
    base = ground.likelihood.mechanism
    effects = (*(h.effect for h in tried), *ground.geometry)
    theta = np.concatenate([np.zeros(0), *starts, _geometry_of(donor, ground)]).tolist()
    if not any(stretches(effect) for effect in effects):
        return Mechanism(base.robot, effects, theta, native=base.native)
    made = Mechanism(base.robot, effects, theta, native=base.native, springs=True)
    known = donor.likelihood.mechanism
    quiet = not ringing and (known.quiet if sprung(known) == sprung(made) else are_stiff(made, donor))
    return Mechanism(base.robot, effects, theta, native=base.native, springs=True, quiet=True) if quiet else made


def _geometry_of(donor: Fit, ground: Ground) -> Float[np.ndarray, " open"]:
    """The geometry that the survey leaves open, as the donor has it."""
    return donor.values[len(donor.values) - (len(ground.known.mean) - BODY) :]


def _bounds(tried: Sequence[Hypothesis], context: Context) -> tuple[np.ndarray, np.ndarray]:
    bounds = [h.effect.bounds(context) for h in tried]
    none = np.zeros(0)
    return np.concatenate([none, *(low for low, _ in bounds)]), np.concatenate([none, *(high for _, high in bounds)])


def _held_along(covariance: np.ndarray, places: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """The covariance (n, n) once it is known how far some parameters are along a direction."""
    along = covariance[:, places] @ direction
    variance = float(direction @ along[places])
    return covariance - np.outer(along, along) / variance if variance > 0 else covariance


def prior_of(tried: Sequence[Hypothesis]) -> Float[np.ndarray, " theta"]:
    """Standard deviations of all θ of some terms before any data."""
    scales = [parameter.scale for h in tried for parameter in h.effect.parameters]
    return SHARED.wide * np.array(scales, dtype=float)
