"""Effects that could replace a named one, by the information matrix at the fitted model.

What a named effect does to the recordings, body, starts and the other effects being adjusted, is a vector; what of it,
and of what it leaves, another effect cannot imitate, within its bounds, is what the data say between the two.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import islice

import numpy as np

from fidim_lab.effects.plausibility import Context
from fidim_lab.identification.mle.evidence import ODDS
from fidim_lab.mismatch.fitting.fit_data import Ground
from fidim_lab.mismatch.fitting.refit import Completed, refit
from fidim_lab.mismatch.linearised.hypotheses import Hypothesis
from fidim_lab.mismatch.scores.score import eliminated, imitated
from fidim_lab.mismatch.scores.thresholds import SCORES
from fidim_lab.mismatch.scores.views import View
from fidim_lab.mismatch.thresholds import SHARED
from fidim_lab.model.side_by_side import found_side_by_side
from fidim_lab.say import Say


@dataclass(frozen=True, eq=False)
class Imitator:
    """Another effect instead of a named one, to first order."""

    tried: Hypothesis
    theta: np.ndarray
    """of all its parameters, at which it comes nearest"""
    loss: float
    """nats, of the evidence for the named one, that it does not reach; below 0 it says more"""
    whole: float
    """nats, of the evidence for the named one"""


def imitators(seen: View, k: int, *, any_cable: bool = False) -> tuple[Imitator, ...]:
    """Of each other effect that may stand for term k of the model that was looked at, the best; the best first.

    What acts on one cable is imitated by what acts on the same cable, or on all alike: the same effect, too.
    any_cable: what acts on none, or on all, may be imitated by what acts on any one.
    """
    model, projected = seen.model, seen.projected
    term, place = model.tried[k], model.place_of(k)
    shared = len(model.fit.values)
    count = len(projected.gram) - 1 - shared
    own = place.start + np.array(term.scored)
    outside = np.setdiff1d(np.arange(shared), np.arange(place.start, place.stop))
    rest = eliminated(projected.gram, outside, np.concatenate([own, shared + np.arange(count + 1)]))
    size = len(own)
    away = model.fit.values[own] - term.absent[list(term.scored)]
    whole = 0.5 * float(away @ rest[:size, :size] @ away) / projected.inflation
    found: dict[str, Imitator] = {}
    for other, columns in zip(projected.tried, projected.slices, strict=True):
        id, cable = other.effect.id, other.effect.cable
        allowed = cable in (None, term.effect.cable) or (any_cable and term.effect.cable is None)
        if not allowed or (id, cable) == (term.effect.id, term.effect.cable):
            continue
        at = slice(size + columns.start, size + columns.stop)
        low, high = (side[list(other.scored)] for side in other.effect.bounds(seen.context))
        best, taken = imitated(rest[at, at], rest[at, :size] @ away - rest[at, -1], low, high)
        loss = whole - 0.5 * taken / projected.inflation
        if other.effect.id not in found or loss < found[other.effect.id].loss:
            found[other.effect.id] = Imitator(other, other.theta(best), loss, whole)
    return tuple(sorted(found.values(), key=lambda one: one.loss))


def in_their_place(seen: View, ground: Ground, say: Say, slight: float = SHARED.slight) -> list[Completed]:
    """The model that was looked at with other effects instead of a term, where they come near; at least two terms.

    What has more freedom than the term is left out, unless it is to say more: it would not convince where it only
    imitates.
    ground: what the model was fitted to. slight: share of a term's evidence that another may miss.
    """
    model = seen.model
    slight = 0.0 if model.mechanism.springs else slight  # fits with springs are dear
    fits: list[Callable[[], Completed | None]] = []
    for k in range(len(model.tried)) if len(model.tried) > 1 else ():
        freedom = len(model.tried[k].scored)
        near = (one for one in imitators(seen, k, any_cable=True) if one.loss < SCORES.views_tie + slight * one.whole)
        worth = (one for one in near if len(one.tried.scored) <= freedom or one.loss < -ODDS)
        for other in islice(worth, SHARED.runners_up):
            say(f"fitting {model.label} with {other.tried.label} instead of {model.tried[k].label}")
            fits.append(partial(in_place_of, model, k, other.tried, other.theta, ground, seen.context))
    return found_side_by_side(fits)


def in_place_of(
    model: Completed, k: int, other: Hypothesis, theta: np.ndarray, ground: Ground, context: Context
) -> Completed | None:
    """The model with another effect, from this θ, instead of term k; None where no fit gets there.

    A fit of whole windows that will hardly get as far as the model is given up.
    """
    tried = [*model.tried[:k], other, *model.tried[k + 1 :]]
    thetas = [*model.thetas[:k], theta, *model.thetas[k + 1 :]]
    return refit(ground, model.fit, tried, thetas, context, simpler=model)
