"""Models found over the first seconds, fitted to whole windows: the best first, then others where it fails."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import islice

from fidim_lab.effects.effect import NamedEffect
from fidim_lab.mismatch.budget import Budget
from fidim_lab.mismatch.fitting.baseline import Baseline
from fidim_lab.mismatch.fitting.refit import Completed, again, refit
from fidim_lab.mismatch.selection.candidates import Candidate, accepted
from fidim_lab.mismatch.selection.generalise import widened
from fidim_lab.mismatch.selection.trials import Trials
from fidim_lab.mismatch.thresholds import SHARED
from fidim_lab.model.side_by_side import side_by_side
from fidim_lab.say import Say


@dataclass(frozen=True, eq=False)
class WholeWindows:
    """Where the models of the first seconds are taken to."""

    start: Baseline
    say: Say
    budget: Budget
    trials: Trials
    hopeless: float = SHARED.hopeless
    """χ²/dof of whole windows, from which a model is not gone on with"""

    def best(self, baseline: Candidate, short: Sequence[Completed]) -> tuple[Candidate, bool]:
        """The best of them or the baseline, and whether any came near whole windows, or none was tried."""
        fresh: list[Candidate] = []
        in_vain: list[set[NamedEffect]] = []
        able = [model for model in short if model.excess < SHARED.hopeless]
        ahead = self._two_at_once(able, baseline.model)
        for k, model in enumerate(able):
            terms = {h.effect for h in model.tried}
            if self.budget.is_spent and (fresh or in_vain):
                break  # what the first seconds say best is seen to its end
            if any(terms <= more for more in in_vain):
                continue  # with fewer terms it can follow no better
            if any(one.is_white for one in fresh) and not self._follows_first_seconds(model):
                continue  # where another follows whole windows
            found = ahead[k] if k in ahead else self._fitted([model], baseline.model)[0]
            if found is not None and found.excess >= self.hopeless:
                in_vain.append(terms)
            elif found is not None:
                # what made good for the first seconds alone may be needless beside the whole
                done = any(one.is_white and len(one.model.tried) <= len(found.tried) for one in fresh)
                # where a model with no more terms leaves only noise, a wider form has nothing to find
                found = self.trials.pruned(found if done else widened(self.start, found, found.tried))
                fresh.append(self.trials.judged_or_wider(found, () if done else found.tried))
        self.trials.tried += fresh
        followed = not (fresh or in_vain) or any(one.model.excess < SHARED.near for one in fresh)
        return accepted(baseline, fresh, feeble=True) or baseline, followed

    def _two_at_once(self, able: Sequence[Completed], as_it_is: Completed) -> dict[int, Completed | None]:
        """The first and the next that has other terms, side by side; none where the first alone is likely to do."""
        if not able or self.budget.is_spent or able[0].is_white:
            return {}
        first = {h.effect for h in able[0].tried}
        others = (k for k, model in enumerate(able) if not {h.effect for h in model.tried} <= first)
        chosen = [0, *islice(others, 1)]
        found = self._fitted([able[k] for k in chosen], as_it_is)
        return dict(zip(chosen, found, strict=True))

    def _fitted(self, models: Sequence[Completed], as_it_is: Completed) -> list[Completed | None]:
        """To whole windows, side by side."""
        for model in models:
            self.say(f"fitting {model.label} to whole windows")
        whole, context = self.start.whole_ground, self.start.context
        return side_by_side(
            [partial(refit, whole, one.fit, one.tried, one.thetas, context, simpler=as_it_is) for one in models]
        )

    def _follows_first_seconds(self, model: Completed) -> bool:
        """Whether it leaves only noise of all the first seconds, too, where it was fitted to fewer."""
        if not model.is_white:
            return False
        start = self.start
        if (model.fit.journey.ends == start.short.journey.ends).all():
            return True
        longer = again(start.short_ground, start.short, model, start.context)
        return longer is not None and longer.is_white
