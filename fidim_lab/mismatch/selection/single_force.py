"""One unknown wrench, fitted where several effects would otherwise be named.

It is found in seconds, while several effects take long to be fitted to whole windows. Where it leaves only noise of all
windows, and follows even the first seconds better than the effects do that were fitted to nothing else, these need not
be fitted to the whole: effects that act would follow there what they cause. Where they are fitted and leave more than
noise, no further ones are looked for beside them.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fidim_lab.data.records import Campaign, Role, Window
from fidim_lab.errors import RefusedError
from fidim_lab.identification.mle.fit import Fit
from fidim_lab.mismatch.fitting.fit_data import ground_of, whole_ground
from fidim_lab.mismatch.fitting.holdout import predict
from fidim_lab.mismatch.fitting.refit import Completed
from fidim_lab.mismatch.selection.candidates import Candidate, candidate
from fidim_lab.mismatch.thresholds import SHARED
from fidim_lab.mismatch.unknown_force.unknown import UnknownForce, model_unknown
from fidim_lab.say import Say


class LoneWrench:
    """The wrench that does nearly all by itself, once it was sought."""

    def __init__(self, baseline: Candidate, campaign: Campaign, say: Say) -> None:
        """baseline: the model as it is, beside which it stands."""
        self._baseline, self._campaign, self._say = baseline, campaign, say
        self.found: UnknownForce | None = None
        """without terms where no wrench does nearly all; None before it was sought, and where none can be sought"""
        self._judged: Candidate | None = None
        """the model with it; None where it has no terms, or predicts no window"""

    def seek(self, short: Sequence[Completed]) -> "LoneWrench":
        """Find it, unless it was found before or these models cannot be stand-ins for it; returns itself.

        short: of the first seconds, the best first.
        """
        if self.found is None and _may_be_stand_ins(short):
            self.found = wrench_beside(self._baseline, self._campaign, short[0].label, self._say, alone=True)
            self._judged = None if self.found is None else self._judge(self.found)
        return self

    def outdoes(self, short: Sequence[Completed]) -> bool:
        """Whether it leaves only noise of all windows, and says more of the first seconds than each of these models.

        short: of the first seconds, the best first.
        """
        found, judged = self.found, self._judged
        if found is None or judged is None or not (judged.is_white and _may_be_stand_ins(short)):
            return False
        return all(nats_beyond(found.fit, one.fit) / judged.whiteness.level**2 > SHARED.enough for one in short)

    @property
    def leaves_noise(self) -> bool:
        """Whether it was found, and nothing but noise is left of all windows."""
        return self._judged is not None and self._judged.is_white

    def _judge(self, found: UnknownForce) -> Candidate | None:
        if not found.terms or not found.after.dof:
            return None
        model = Completed((), found.fit, whole=True)
        return candidate(model, predict(model, self._campaign.of_role(Role.VALIDATE)))


def _may_be_stand_ins(short: Sequence[Completed]) -> bool:
    """One effect that leaves only noise of the first seconds is none."""
    return bool(short) and not (len(short[0].tried) == 1 and short[0].is_white)


def wrench_beside(baseline: Candidate, campaign: Campaign, names: str, say: Say, *, alone: bool) -> UnknownForce | None:
    """A wrench beside the model as it is, without terms where there is none; None where none can be sought.

    names: what else may be named, for what is said. alone: only one that does nearly all by itself.
    """
    say(f"modelling one unknown force in place of {names}")
    try:
        return modelled(baseline, campaign, alone=alone)
    except RefusedError:
        return None


def modelled(named: Candidate, campaign: Campaign, *, alone: bool = False) -> UnknownForce:
    """The residual beside these effects as an unknown wrench, on whole windows.

    alone: only where one wrench does nearly all (see `model_unknown`). Raises RefusedError where windows cannot be
    followed.
    """
    base = whole_fit(named.model, campaign.of_role(Role.IDENTIFY))
    return model_unknown(base, campaign.of_role(Role.VALIDATE), before=named.held_out, alone=alone)


def whole_fit(named: Completed, windows: Sequence[Window]) -> Fit:
    """The fit on whole recordings, even where it was fitted to their first seconds only."""
    if named.whole:
        return named.fit
    return replace(named.fit, likelihood=whole_ground(ground_of(named.fit), windows).likelihood)


def nats_beyond(whole: Fit, short: Fit) -> float:
    """How much better a fit of whole windows explains the first seconds than a fit of only these.

    −∞ where it loses samples that the other follows. Freedom that it has more is charged for as by the Bayesian
    information criterion; what it has less is not put to its credit.
    """
    gained, count = 0.0, 0
    for all_of_it, first in zip(whole.remainders, short.remainders, strict=True):
        near = all_of_it.residuals[all_of_it.t <= first.t[-1] + 1e-9]
        seen = int(np.isfinite(first.residuals).sum())
        if int(np.isfinite(near).sum()) < seen:
            return -np.inf
        gained += float(np.nansum(first.residuals**2) - np.nansum(near**2))
        count += seen
    more = max(0, len(whole.values) - len(short.values))
    return 0.5 * gained / short.likelihood.noise**2 - 0.5 * np.log(max(count, 1)) * more
