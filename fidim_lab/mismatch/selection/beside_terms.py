"""What is no term, and may say more beside a model's terms than any further one: asked of each model on the way."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from fidim_lab.data.records import Campaign
from fidim_lab.identification.mle.evidence import ODDS
from fidim_lab.identification.mle.fit import Fit
from fidim_lab.mismatch.fitting.refit import Completed, evidence
from fidim_lab.mismatch.scores.views import View
from fidim_lab.mismatch.selection.general_geometry import Opening, most_of_effects, opening, rival
from fidim_lab.mismatch.session.changes import SessionChanges, session_changes
from fidim_lab.mismatch.thresholds import SHARED

MOVED = 1.0
"""standard deviations by which changes move beside a model that are worth beginning again"""


@dataclass(frozen=True, eq=False)
class ChangesBeside:
    """Changes between windows that say more beside a model than any further effect."""

    beside: Completed
    changes: SessionChanges


@dataclass(frozen=True, eq=False)
class Beside:
    """What a search is broken off for."""

    geometry: bool = False
    """an open one"""
    changes: bool = False
    """what differs between windows"""
    corrected: SessionChanges | None = None
    """changes that the windows are corrected for, which are estimated again"""

    def leading(self, seen: View, campaign: Campaign) -> Opening | ChangesBeside | None:
        """What leads at the model that was looked at; None where nothing does, or the model has no terms yet."""
        if not seen.model.tried or seen.model.is_white:
            return None
        if self.corrected is not None:
            sharper, moved = self.corrected.sharpened(seen.fit)
            if moved > MOVED:
                return ChangesBeside(seen.model, sharper)
        found = opening(seen) if self.geometry else None
        if found is not None or not self.changes:
            return found
        changes = session_changes(seen.fit, campaign, SHARED.enough)
        if changes is None or not _follows(changes, seen.fit) or self._others_say_more(seen, changes):
            return None
        return ChangesBeside(seen.model, changes)

    def instead_of(
        self,
        further: Completed,
        fewer: Sequence[Completed],
        campaign: Campaign,
        look: Callable[[Completed], View],
    ) -> ChangesBeside | None:
        """Changes beside a model with fewer terms, where these lead what the further ones say; else None.

        look: all scores at a model.
        """
        for model in sorted(fewer, key=lambda model: model.chi2)[: SHARED.leaders if self.changes else 0]:
            changes = session_changes(model.fit, campaign, SHARED.enough)
            if changes is None or not _follows(changes, model.fit):
                continue
            scale = min(changes.temper, max(1.0, further.fit.chi2_per_dof))
            leads = changes.nats >= evidence(further, model, scale) + ODDS
            if leads and not self._others_say_more(look(model), changes):
                return ChangesBeside(model, changes)
        return None

    def _others_say_more(self, seen: View, changes: SessionChanges) -> bool:
        """Whether they do not lead the further effects, or a geometry that could be open, by odds of 20."""
        general = rival(seen) if self.geometry else None
        return effects_say_more(seen, changes) or (general is not None and changes.nats < general.best + ODDS)


def effects_say_more(seen: View, changes: SessionChanges) -> bool:
    """Whether changes do not lead the effects that were looked at by odds of 20."""
    return changes.nats < most_of_effects(seen, changes.temper) + ODDS


def _follows(changes: SessionChanges, found: Fit) -> bool:
    """Whether they are foretold to follow the motion beside the model that was fitted."""
    return changes.temper <= SHARED.near * max(1.0, found.noise_ratio**2)
