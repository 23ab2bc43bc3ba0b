"""What is no term, and may say more beside a model's terms than any further one: asked of each model on the way."""

from dataclasses import dataclass

from fidim_lab.data.records import Campaign
from fidim_lab.identification.mle.evidence import ODDS
from fidim_lab.mismatch.fitting.refit import Completed
from fidim_lab.mismatch.scores.views import View
from fidim_lab.mismatch.selection.general_geometry import Opening, most_of_effects, opening
from fidim_lab.mismatch.session.changes import SessionChanges, session_changes
from fidim_lab.mismatch.thresholds import SHARED


@dataclass(frozen=True, eq=False)
class ChangesBeside:
    """Changes between windows that say more beside a model than any further effect."""

    beside: Completed
    changes: SessionChanges


@dataclass(frozen=True)
class Beside:
    """Which of these a search is broken off for."""

    geometry: bool = False
    """an open one"""
    changes: bool = False
    """what differs between windows"""

    def leading(self, seen: View, campaign: Campaign) -> Opening | ChangesBeside | None:
        """What leads at the model that was looked at; None where nothing does, or the model has no terms yet."""
        found = opening(seen) if self.geometry else None
        if found is not None or not self.changes or not seen.model.tried or seen.model.is_white:
            return found
        changes = session_changes(seen.fit, campaign, SHARED.enough)
        return ChangesBeside(seen.model, changes) if changes is not None and _leads(seen, changes) else None


def effects_say_more(seen: View, changes: SessionChanges) -> bool:
    """Whether changes do not lead the effects that were looked at by odds of 20."""
    return changes.nats < most_of_effects(seen, changes.temper) + ODDS


def _leads(seen: View, changes: SessionChanges) -> bool:
    """Whether they are foretold to follow the motion, and say more than any further effect or pair of effects."""
    follows = changes.temper <= SHARED.near * max(1.0, seen.fit.noise_ratio**2)
    return follows and not effects_say_more(seen, changes)
