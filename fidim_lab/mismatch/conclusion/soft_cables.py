"""What the model of a soft robot lacks: elastic cables with and without dissipation (spec/irma4u.md §5).

Where rigid cables are the wrong model, the search among effects beside them says nothing. Here the elastic fit
(`identification.mle.soft`) is the ground: it is fitted without any dissipation, with each of its two terms alone, with
friction elsewhere in the place of that at the attachments, with friction elsewhere or drag of the air in the place of
both, and with friction that slips at once where that of the ground gives way first. Windows that no fit has seen
decide.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from fidim_lab.data.records import Campaign, Role, Window
from fidim_lab.effects.dissipation.air_drag import AirDragLinear, AirDragQuadratic
from fidim_lab.effects.dissipation.attachment_friction import AttachmentFriction
from fidim_lab.effects.dissipation.pulley_friction import PulleyFriction
from fidim_lab.effects.dissipation.rotational_drag import RotationalDragPerAxis
from fidim_lab.effects.dissipation.swivel_friction import SwivelFriction
from fidim_lab.effects.effect import NamedEffect
from fidim_lab.effects.plausibility import Context
from fidim_lab.errors import RefusedError
from fidim_lab.identification.mle import held_out
from fidim_lab.identification.mle.fit import Fit, fit
from fidim_lab.identification.mle.soft import BEGINNINGS, POSSIBLE, SoftFit, fit_soft
from fidim_lab.identification.mle.trajectories.recordings import prepare
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.slots import Effect
from fidim_lab.say import Say

DRAG = RotationalDragPerAxis()
ELSEWHERE = (SwivelFriction(), PulleyFriction())
"""friction that would stand in the place of that at the attachments"""
ALONE = (*ELSEWHERE, AirDragLinear(), AirDragQuadratic())
"""what would stand in the place of both terms"""


@dataclass(frozen=True, eq=False)
class Elastic:
    """One elastic model and what it predicts."""

    effects: tuple[NamedEffect, ...]
    """of what dissipates"""
    found: Fit
    rms: dict[str, float]
    """m, of each held-out window that could be predicted"""
    chi2_per_dof: float
    """of these, by the stated noise"""

    @property
    def held_out(self) -> float:
        """m, over all held-out windows; nan where none could be predicted."""
        return float(np.sqrt(np.mean(np.square(list(self.rms.values()))))) if self.rms else float("nan")

    @property
    def cost(self) -> float:
        """Sum of squares of the fitted windows, by the working noise, and of the priors."""
        return self.found.journey.optimum.cost

    def theta_of(self, effect: NamedEffect) -> tuple[Float[np.ndarray, " p"], Float[np.ndarray, " p"], np.ndarray]:
        """Values, standard deviations, and upper bounds of an effect in this model."""
        place = self.found.place_of(effect)
        _, high = self.found.prior.bounds
        return self.found.values[place], self.found.sd[place], high[place]


@dataclass(frozen=True, eq=False)
class Compared:
    """The elastic models of one campaign."""

    soft: SoftFit
    whole: Elastic
    """with both terms that dissipate"""
    without: Elastic
    """with none"""
    single: tuple[Elastic, ...]
    """with one of them"""
    elsewhere: tuple[Elastic, ...]
    """with other friction in the place of that at the attachments; those that could be fitted"""
    alone: tuple[Elastic, ...] = ()
    """with something else in the place of both terms; those that could be fitted"""
    at_once: Elastic | None = None
    """with friction that slips at once, where that of `whole` gives way before"""

    @property
    def dissipation(self) -> tuple[NamedEffect, NamedEffect]:
        """Both terms: friction at the attachments, drag."""
        friction, drag = self.whole.effects
        return friction, drag

    @property
    def same_law(self) -> Elastic:
        """With friction at the attachments by the law that friction `elsewhere` has."""
        return self.whole if self.at_once is None else self.at_once

    def behind(self, other: Elastic) -> float:
        """Nats by which another model fits the fitted windows worse than the whole."""
        return 0.5 * (other.cost - self.whole.cost)


def compare(campaign: Campaign, say: Say) -> Compared:
    """Fit them all. Raises RefusedError where the elastic model cannot be fitted with dissipation or without."""
    say("fitting elastic cables with what dissipates rotation")
    soft = fit_soft(campaign)
    windows = campaign.of_role(Role.VALIDATE)
    friction = soft.friction
    whole = _judged(soft, soft.found, (friction, DRAG), windows)
    at_once = None if soft.at_once is None else _judged(soft, soft.at_once, (AttachmentFriction(), DRAG), windows)

    def variant(*effects: NamedEffect) -> Elastic:
        say(f"fitting elastic cables with {' and '.join(e.label for e in effects) or 'nothing that dissipates'}")
        return _judged(soft, _fitted(soft, effects), effects, windows)

    without = variant()
    single: list[Elastic] = []
    elsewhere: list[Elastic] = []
    alone: list[Elastic] = []
    for into, effects in (
        (single, (friction,)),
        (single, (DRAG,)),
        *((elsewhere, (other, DRAG)) for other in ELSEWHERE),
        *((alone, (other,)) for other in ALONE),
    ):
        try:
            into.append(variant(*effects))
        except RefusedError as refusal:
            say(str(refusal))
    return Compared(soft, whole, without, tuple(single), tuple(elsewhere), tuple(alone), at_once)


def _fitted(soft: SoftFit, effects: Sequence[NamedEffect]) -> Fit:
    """The elastic fit with these terms in the place of those that dissipate, from the first beginning."""
    found = soft.found
    mechanism, prior = found.likelihood.mechanism, found.prior
    parts: list[tuple[Effect, np.ndarray]] = []
    low, high = prior.bounds
    for effect in mechanism.effects:
        if effect in (soft.friction, DRAG) and effect not in effects:
            continue
        place = found.place_of(effect)
        parts.append((effect, np.array([prior.mean[place], found.plausible[place], low[place], high[place]])))
    for effect in effects:
        if effect not in mechanism.effects:
            least, most = effect.bounds(Context.of(mechanism.robot))
            parts.append((effect, np.array([BEGINNINGS[0] * POSSIBLE * most, POSSIBLE * most, least, most])))
    theta, sd, low, high = np.concatenate([part for _, part in parts], axis=1)
    made = Mechanism(mechanism.robot, tuple(effect for effect, _ in parts), theta.tolist(), native=mechanism.native)
    windows = [recording.window for recording in found.likelihood.recordings]
    return fit(made, windows, theta_sd=sd, bounds=(low, high))


def _judged(soft: SoftFit, found: Fit, effects: tuple[NamedEffect, ...], windows: Sequence[Window]) -> Elastic:
    mechanism = found.likelihood.mechanism
    ratio = soft.working.marker_noise / soft.found.likelihood.noise
    rms: dict[str, float] = {}
    chi2, dof = 0.0, 0
    for window in windows:
        try:
            seen = held_out.predict(mechanism, found.values, prepare(window, mechanism.robot), soft.working)
        except RefusedError:
            continue
        rms[window.id] = seen.remainder.rms
        chi2, dof = chi2 + seen.remainder.chi2 * ratio**2, dof + seen.remainder.dof
    return Elastic(effects, found, rms, chi2 / dof if dof else float("nan"))
