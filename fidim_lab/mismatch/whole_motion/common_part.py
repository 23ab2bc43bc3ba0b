"""What every model of a search through whole windows contains, fitted without any term: rigid cables or elastic ones.

Elastic cables bring unknowns that every such robot has (how soft its cables are, encoder zeros, frames of cameras and
markers), so they are in every model under their priors, and no term is named for what they do.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fidim_lab.data.records import Campaign, Role
from fidim_lab.effects.plausibility import Context
from fidim_lab.errors import RefusedError
from fidim_lab.identification.mle.fit import Fit, fit
from fidim_lab.identification.mle.soft import fit_soft
from fidim_lab.identification.mle.trajectories.recordings import FollowedSamples, prepare
from fidim_lab.identification.mle.warm_start import rearranged
from fidim_lab.mismatch.fitting.baseline import context_of
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.slots import Effect
from fidim_lab.say import Say


@dataclass(frozen=True, eq=False)
class CommonPart:
    """A model without any term, fitted to whole windows."""

    found: Fit
    nuisances: tuple[Effect, ...] = ()
    """in every model: none where cables are rigid"""
    noise: float = 1.0
    """χ²/dof of white noise of the stated size, by the noise that these fits are whitened with"""
    elsewhere: tuple[Fit, ...] = ()
    """of the same windows and noise with further effects: other optima, from where a model can begin as well"""
    sentences: tuple[str, ...] = ()
    """what is said of them"""

    @cached_property
    def context(self) -> Context:
        """What is physically possible, by the fitted motion."""
        return context_of(self.found)

    @cached_property
    def nuisance_sd(self) -> np.ndarray:
        """Of their θ before any data."""
        plausible = self.found.plausible
        return np.concatenate([np.zeros(0), *(plausible[self.found.place_of(one)] for one in self.nuisances)])

    def prepared(self, campaign: Campaign, role: Role, say: Say) -> tuple[FollowedSamples, ...]:
        """Windows of a role as these models predict them; those that cannot be, are told."""
        kept: list[FollowedSamples] = []
        for window in campaign.of_role(role):
            try:
                kept.append(prepare(window, self.found.likelihood.mechanism.robot))
            except RefusedError as refusal:
                say(str(refusal))
        return tuple(kept)


def rigid(campaign: Campaign, mechanism: Mechanism) -> CommonPart:
    """With rigid cables. Raises RefusedError where no window can be fitted."""
    return CommonPart(fit(mechanism, campaign.of_role(Role.IDENTIFY)))


def elastic(campaign: Campaign, softness: str) -> CommonPart:
    """With elastic cables, where rigid ones are the wrong model. Raises RefusedError where they cannot be fitted.

    softness: how that is seen, for people.
    """
    soft = fit_soft(campaign)
    with_dissipation = soft.by_working_noise
    found = rearranged(with_dissipation, soft.not_dissipating)
    if found is None:
        raise RefusedError("Without dissipation no motion on elastic cables can be simulated.")
    why = f"The cables hardly hold one direction ({softness}): elastic cables are fitted instead of rigid ones."
    ratio = campaign.robot.sensors.marker_noise / soft.working.marker_noise
    return CommonPart(found, soft.not_dissipating, ratio**2, (with_dissipation,), (why, soft.springs, *soft.cut))
