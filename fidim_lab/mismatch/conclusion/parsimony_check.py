"""Whether an unknown wrench explains more, with fewer parameters, than the effects that are to be named.

Effects with much freedom (a hose that may end anywhere, a force of any frequency) can follow what they are not, and so
can several effects together: drag of the speed cubed by drag of its square beside a small force that oscillates. Where
one smooth wrench does so more simply they are stand-ins, and nothing is named.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fidim_lab.data.records import Campaign, Role, Window
from fidim_lab.identification.mle.fit import Fit
from fidim_lab.mismatch.conclusion.explanation import Verdict
from fidim_lab.mismatch.conclusion.thresholds import CONCLUSION
from fidim_lab.mismatch.conclusion.verdict import Judged
from fidim_lab.mismatch.fitting.holdout import chi2_beyond_errors
from fidim_lab.mismatch.selection.candidates import Candidate
from fidim_lab.mismatch.selection.select import Selection
from fidim_lab.mismatch.selection.single_force import wrench_beside
from fidim_lab.mismatch.thresholds import SHARED
from fidim_lab.mismatch.unknown_force.unknown import UnknownForce
from fidim_lab.say import Say


def unless_outdone(judged: Judged, found: Selection, campaign: Campaign, say: Say) -> Judged:
    """The verdict, or unknown physics where an unknown wrench explains more.

    campaign: of which the models are. Only effects of many parameters, or several together, are doubted, and on whole
    windows alone.
    """
    named, baseline = judged.named, found.baseline
    many = sum(len(term.effect.parameters) for term in named.model.tried) >= CONCLUSION.parsimony_check_many
    doubted = judged.known and (many or len(named.model.tried) >= CONCLUSION.parsimony_check_several)
    if not doubted or not named.model.whole or named.model.mechanism.springs:
        return judged
    if not campaign.of_role(Role.VALIDATE):
        return judged
    rival = found.alone
    if many or rival is None:
        rival = wrench_beside(baseline, campaign, named.model.label, say, alone=not many)
    if rival is None or not rival.terms or not _says_more(rival, named, campaign.of_role(Role.VALIDATE)):
        return judged
    return replace(judged, verdict=Verdict.UNKNOWN_PHYSICS, named=baseline, outdone_by=rival)


def _says_more(rival: UnknownForce, named: Candidate, windows: Sequence[Window]) -> bool:
    """Of fitted windows by the Bayesian information criterion, and of held-out `windows` by what is left.

    The criterion charges each parameter with more than it can gain where the named effects are the truth. Where these
    lose windows that the wrench follows, they are charged for them as for the rest. What an open geometry leaves
    undetermined moves all predictions, and says nothing of either model: then only what is beyond that counts.
    """
    fitted, level = named.model.fit, named.whiteness.level**2
    dof = sum(left.dof for left in rival.fit.remainders)
    if dof < named.model.dof or rival.after.dof < named.held_out.dof or not named.held_out.dof:
        return False
    gained = named.model.chi2 * dof / named.model.dof - sum(left.chi2 for left in rival.fit.remainders)
    price = 0.5 * np.log(dof) * (_unknowns(rival.fit) - _unknowns(fitted))
    held = (named.held_out.chi2, named.held_out.dof), (rival.after.chi2, rival.after.dof)
    if named.model.has_open_geometry:
        held = chi2_beyond_errors(fitted, windows), chi2_beyond_errors(rival.fit, windows)
    (ours, count), (theirs, many) = held
    foretold = ours * many / count - theirs
    return min(0.5 * gained / level - price, 0.5 * foretold / level) > SHARED.enough


def _unknowns(fit: Fit) -> int:
    likelihood = fit.likelihood
    return len(fit.values) + likelihood.own * len(likelihood.recordings)
