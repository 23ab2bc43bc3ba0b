"""A campaign corrected for what differs between its windows, where that says more than effects.

Changes between windows (`session`) and effects bend each other: what leads comes first, and is estimated again beside
the other as soon as a model on the way says so. A correction is kept where it leaves noise with one effect at most
beside it, or else where its terms say more than those of a search without it; where neither leaves noise, where it
leaves not half as much.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

from fidim_lab.errors import RefusedError
from fidim_lab.identification.mle.evidence import ODDS
from fidim_lab.identification.mle.fit import Fit
from fidim_lab.mismatch.cleaning.clean import Cleaned
from fidim_lab.mismatch.fitting.baseline import Baseline
from fidim_lab.mismatch.fitting.refit import Completed, again
from fidim_lab.mismatch.rounds import Reached, Rounds, takes_more
from fidim_lab.mismatch.selection.beside_terms import Beside, ChangesBeside, effects_say_more
from fidim_lab.mismatch.selection.candidates import candidate, improves
from fidim_lab.mismatch.selection.general_geometry import FirstLook, rival
from fidim_lab.mismatch.session.changes import SETTLED, SessionChanges, session_changes
from fidim_lab.mismatch.thresholds import SHARED

WORTH = 0.2
"""of what there is to explain, which a correction must take to be searched with before a search without it: a load
beside swivel damping takes 0.33, one that is none, beside heavy cables and drag, 0.07"""
PAIR = 2
"""terms that changes are weighed against before a search (`most_of_effects`): with no more nothing else is asked"""


def with_corrections(rounds: Rounds, cleaned: Cleaned) -> Reached:
    """All rounds of a cleaned campaign. Raises RefusedError where no window can be fitted at all."""
    recorded = rounds.fitted(cleaned.campaign)
    look = FirstLook(recorded, rounds.say)
    session = _Session(rounds, cleaned, recorded)
    right, corrected = session.instead_of_effects(look), None
    if right is not None and session.takes(right, look, WORTH):
        corrected = session.searched(right)
        if session.takes(right, look, SHARED.half) or _is_plain(corrected):
            return corrected
    found = replace(rounds, beside=Beside(changes=corrected is None)).searched(cleaned, recorded, look)
    off = found.last.found.changes
    if off is not None:
        right = session.corrected(off.changes)
        corrected = None if right is None or not _keeps_promise(right, off) else session.searched(right)
        if corrected is not None and _is_plain(corrected):
            return corrected
        found = replace(rounds, beside=Beside()).searched(cleaned, recorded, look)
    if corrected is None:
        return session.beside_effects(found)
    return corrected if _explains_more(corrected, found) else found


@dataclass(frozen=True, eq=False)
class _Corrected:
    """The campaign corrected for changes, with its baseline."""

    rounds: Rounds
    """of the robot with the noise that was found"""
    cleaned: Cleaned
    look: FirstLook
    changes: SessionChanges

    def searched(self, recorded: Baseline, known: Completed | None, *, seeks: bool) -> Reached:
        """Where the search of it ends, or is broken off for changes that are seen better beside a model."""
        beside = Beside(corrected=self.changes if seeks else None)
        found = replace(self.rounds, beside=beside).searched(self.cleaned, recorded, self.look, known)
        return replace(found, changes=self.changes)


@dataclass(frozen=True, eq=False)
class _Session:
    """One campaign as it was recorded, and what its corrections share."""

    rounds: Rounds
    cleaned: Cleaned
    recorded: Baseline

    def instead_of_effects(self, look: FirstLook) -> _Corrected | None:
        """Corrected, where changes say more than effects and geometry; else None.

        A wrong geometry makes lengths miss by another amount in every window too: a change counts only where it is
        evident beside an open geometry, and more so than any effect there.
        """
        recorded, seen = look.exact, look.seen
        changes = session_changes(recorded.fit, recorded.campaign, SHARED.enough)
        if changes is None or effects_say_more(look.scores, changes):
            return None
        beside: SessionChanges | None = None
        if not recorded.geometry:
            beside = session_changes(look.opened.fit, recorded.campaign, SHARED.enough)
            if beside is None or effects_say_more(FirstLook(look.opened, self.rounds.say).scores, beside):
                return None
            changes = changes if changes.kinds <= beside.kinds else beside
        right = self._sharpened(changes, lambda look: look.exact)
        if seen is None or right is None:
            return right
        if changes.moves_body and beside is not None and right.look.seen is not None:  # a wrong geometry bends it
            right = self._sharpened(beside, lambda look: look.opened)
        return right

    def takes(self, right: _Corrected, look: FirstLook, share: float) -> bool:
        """Whether the correction alone leaves only noise, or takes this share of what there is to explain."""
        if look.seen is None:
            return True
        before, after = (candidate(one.as_it_is, one.predicted) for one in (look.exact, right.look.exact))
        if not (after.is_white or look.exact.geometry):  # what an open geometry takes as well is not theirs
            before, after = (candidate(one.as_it_is, one.predicted) for one in (look.opened, right.look.opened))
        takes = after.is_white or after.whiteness.excess < (1 - share) * before.whiteness.excess
        return takes and improves(after, before, feeble=True)

    def searched(self, right: _Corrected) -> Reached:
        """Where the search ends, with the changes estimated again beside the models that it finds."""
        known: Completed | None = None
        found = right.searched(self.recorded, known, seeks=True)
        for _ in range(SHARED.rounds):
            off, best = found.last.found.changes, found.last.found.best.model
            known = best if off is None else off.beside
            if off is not None:
                sharper = self.corrected(off.changes)
            else:
                sharper = self._again(right, best.fit) if best.tried else None
            if sharper is None:
                break
            following = sharper.searched(self.recorded, known, seeks=off is not None)
            if off is None and following.last.unexplained > found.last.unexplained:
                return found
            right, found = sharper, following
        return found if found.last.found.changes is None else right.searched(self.recorded, known, seeks=False)

    def beside_effects(self, found: Reached) -> Reached:
        """Corrected for what changes beside effects that leave only noise of the markers; else what was found."""
        best, last = found.last.found.best, found.last
        if not (best.is_white and best.model.tried and best.model.whole):
            return found
        general = rival(last.found.last)
        if general is not None and general.best > ODDS:
            return found  # a geometry that could be open says as much
        changes = session_changes(best.model.fit, last.cleaned.campaign, SHARED.enough)
        right = None if changes is None else self.corrected(changes)
        if right is None:
            return found
        corrected = right.searched(self.recorded, None, seeks=False)
        kept = corrected.last.found.best.is_white and corrected.last.unexplained <= found.last.unexplained
        return corrected if kept else found

    def corrected(self, changes: SessionChanges) -> _Corrected | None:
        """As `_fitted`; a step among windows that were not fitted stands where these are predicted best."""
        best = self._fitted(changes)
        if best is None or changes.are_placed:
            return best
        fitted = [recording.window.id for recording in best.look.exact.fit.likelihood.recordings]
        tried = [one for other in changes.placed(fitted) if (one := self._fitted(other)) is not None]
        best = min((best, *tried), key=lambda one: one.look.exact.predicted.chi2)
        return replace(best, changes=replace(best.changes, are_placed=True))

    def _fitted(self, changes: SessionChanges) -> _Corrected | None:
        """The readings as their sensors should have read, and the body as each window has it, fitted.

        None where no motion follows from these, as of a body that cannot exist.
        """
        what = "the body is" if changes.moves_body else "lengths or cameras read"
        self.rounds.say(f"{what} not the same in all windows: fitting with that corrected")
        campaign = changes.put_right(self.cleaned.campaign)
        rounds = self.rounds.of_robot(campaign.robot)
        try:
            baseline = rounds.fitted(campaign)
        except RefusedError:
            return None
        return _Corrected(
            rounds, replace(self.cleaned, campaign=campaign), FirstLook(baseline, self.rounds.say), changes
        )

    def _sharpened(self, changes: SessionChanges, fitted: Callable[[FirstLook], Baseline]) -> _Corrected | None:
        """Corrected, with the body estimated again at its own fits; fitted: which of these, of the look at each.

        Where another effect is missing, too, that may lead away: what follows the motion less well is not taken.
        """
        right = self.corrected(changes)
        if right is None:
            return None
        for _ in range(SHARED.rounds if changes.moves_body else 0):
            before = fitted(right.look)
            sharper = self._again(right, before.fit)
            if sharper is None or fitted(sharper.look).short.excess > before.short.excess:
                break
            right = sharper
        return right

    def _again(self, right: _Corrected, found: Fit) -> _Corrected | None:
        """With the changes estimated again at a fit of the campaign that they corrected; None where they stay."""
        sharper, moved = right.changes.sharpened(found)
        return None if moved < SETTLED else self.corrected(sharper)


def _keeps_promise(right: _Corrected, off: ChangesBeside) -> bool:
    """Whether the model beside which the changes were seen leaves as little with them as was foretold, or half so."""
    model, exact = off.beside, right.look.exact
    ground, donor = (exact.whole_ground, exact.as_it_is.fit) if model.whole else (exact.short_ground, exact.short)
    found = again(ground, donor, model, exact.context)
    if found is None:
        return False
    foretold = model.fit.chi2_per_dof - off.changes.temper
    return model.fit.chi2_per_dof - found.fit.chi2_per_dof >= SHARED.half * foretold


def _is_plain(found: Reached) -> bool:
    """Whether only noise is left, with one effect at most beside one change."""
    return found.last.found.best.is_white and found.terms <= PAIR


def _explains_more(corrected: Reached, found: Reached) -> bool:
    """Whether it leaves noise and each further term says enough of held-out windows, or else less than half as much."""
    best, other = corrected.last.found.best, found.last.found.best
    if best.is_white and other.is_white:
        further = corrected.terms - found.terms
        return best.held_out.chi2 + 2 * SHARED.enough * further < other.held_out.chi2
    return best.is_white or not takes_more(found.last, corrected.last)
