"""A model with further terms, chosen by their scores and fitted.

Scores are statements to first order over as long as the model follows the motion. Where that is less than what is to be
fitted, the terms race there first, each from the values at which it was scanned while none suits, and the few best go
on to the whole from where they are: from the model's own fit of the whole, bent as it is, the optimum is often not
found at all.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import islice

import numpy as np

from fidim_lab.effects.plausibility import Context
from fidim_lab.identification.mle.starts.springs import stretches
from fidim_lab.mismatch.fitting.fit_data import Ground
from fidim_lab.mismatch.fitting.refit import Completed, evidence, refit
from fidim_lab.mismatch.linearised.hypotheses import PERIODIC, Hypothesis
from fidim_lab.mismatch.scores.score import Score
from fidim_lab.mismatch.scores.views import View
from fidim_lab.mismatch.selection.candidates import common_scale
from fidim_lab.mismatch.selection.thresholds import SELECTION
from fidim_lab.mismatch.thresholds import SHARED
from fidim_lab.model.side_by_side import side_by_side


@dataclass(frozen=True, eq=False)
class Addition:
    """Terms to be added to a model."""

    seen: View
    """of the model"""
    score: Score
    near: Completed | None = None
    """the model with them, over the time of the view"""

    def fitted(self, ground: Ground, context: Context) -> Completed | None:
        """The model with these terms; one that it has already begins anew as the score says. None: no fit gets there.

        Where the model follows the motion, terms begin from nothing: the first step moves body and starts along with
        them, which a leap of θ alone leaves behind.
        ground: what the model was fitted to, or more.
        """
        model, near = self.seen.model, self.near
        if near is not None:
            found = refit(ground, near.fit, near.tried, near.thetas, context, simpler=model)
            if found is not None:
                return found
        tried, thetas = _beside(model.tried, model.thetas, self.score)
        follows = model.mechanism.springs or self.seen.fit is model.fit
        if follows and not _stretches(self.score) and self.score.phases is None:
            known = len(tried) - len(self.score.tried)
            thetas = [*thetas[:known], *(h.absent for h in self.score.tried)]
        return refit(ground, model.fit, tried, thetas, context, phases=self.score.phases, simpler=model)


def additions(seen: View, room: int, ground: Ground, context: Context) -> tuple[Addition, ...]:
    """The hypotheses worth adding to the model, for so many more terms at most."""
    scores = seen.additions(room)
    if not seen.races:
        return tuple(Addition(seen, score) for score in scores)
    short = Completed(seen.model.tried, seen.fit, whole=False)
    near = _raced(seen, short, scores, ground.as_far_as(seen.fit), context)
    raced = [Addition(seen, score, one) for score, one in zip(scores, near, strict=True)]
    return _finalists(short, raced)


def _finalists(short: Completed, raced: Sequence[Addition]) -> tuple[Addition, ...]:
    """Those that convince most over the short time, and before them up to half as many that could not race.

    These are of cables that stretch, and stay where their scores put them; beside two terms that do not follow even the
    short time they are not tried: they would have to be found from nothing. What was not found comes last.
    """
    scale = common_scale([short, *(one.near for one in raced if one.near is not None)])

    def convincing(one: Addition) -> float:
        return -np.inf if one.near is None else evidence(one.near, short, scale)

    apart = [one for one in raced if not _may_race(short, one.score)]
    others = sorted((one for one in raced if _may_race(short, one.score)), key=convincing, reverse=True)
    apart = apart[: 0 if len(short.tried) > 1 else SELECTION.additions_finalists // 2]
    return (*apart, *others[: SELECTION.additions_finalists - len(apart)])


def _may_race(short: Completed, score: Score) -> bool:
    """Whether terms can begin at a fit of the short time: cables that stretch only where it follows the motion."""
    return short.excess < SHARED.near or not _stretches(score)


def _stretches(score: Score) -> bool:
    """Whether it is of cables that stretch."""
    return any(stretches(h.effect) for h in score.tried)


def _raced(
    seen: View, short: Completed, scores: Sequence[Score], near: Ground, context: Context
) -> list[Completed | None]:
    """The model with the terms of each score over the time of the view; None where none is found, or none may race.

    Where a score leaves more than noise, other values of what is scanned are tried: the first that leaves only noise
    is taken, else the best.
    """
    race = partial(_race, seen, short, near, context)
    able = [k for k, score in enumerate(scores) if _may_race(short, score)]
    best = dict(zip(able, side_by_side([partial(race, scores[k]) for k in able]), strict=True))
    others = [(k, one) for k in able if not _is_noise(best[k]) for one in _scanned(seen, scores[k])]
    further = side_by_side([partial(race, one, rival=best[k]) for k, one in others])
    for (k, _), found in zip(others, further, strict=True):
        now = best[k]
        if found is not None and (now is None or (found.excess < now.excess and not _is_noise(now))):
            best[k] = found
    return [best.get(k) for k in range(len(scores))]


def _race(
    seen: View, short: Completed, near: Ground, context: Context, score: Score, rival: Completed | None = None
) -> Completed | None:
    """The model with the terms of one score, from where it says; given up where it hardly gets as far as a rival."""
    tried, thetas = _beside(short.tried, short.thetas, score)
    return refit(near, seen.fit, tried, thetas, context, rival=rival)


def _is_noise(found: Completed | None) -> bool:
    return found is not None and found.is_white


def _scanned(seen: View, score: Score) -> Iterator[Score]:
    """Scores of the same effect at other values of what is scanned."""
    effect = score.tried[0].effect
    if len(score.tried) == 1 and effect.id not in PERIODIC:
        others = (s for s in seen.singles if s is not score and s.tried[0].effect == effect)
        yield from islice(others, SELECTION.additions_scanned - 1)


def _beside(
    tried: tuple[Hypothesis, ...], thetas: list[np.ndarray], score: Score
) -> tuple[tuple[Hypothesis, ...], list[np.ndarray]]:
    """Terms and θ with those of a score in the place of any that they stand for."""
    new = {(h.effect.id, h.effect.cable) for h in score.tried}
    kept = [k for k, h in enumerate(tried) if (h.effect.id, h.effect.cable) not in new]
    fresh = [h.theta(theta) for h, theta in zip(score.tried, score.theta, strict=True)]
    return (*(tried[k] for k in kept), *score.tried), [*(thetas[k] for k in kept), *fresh]
