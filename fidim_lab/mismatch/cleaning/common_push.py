"""A weak push at the same time of every window: a hand that acts on a signal.

Two tests, both to first order about the model, which is enough for what is soft. Where every two seconds begin anew,
a push shows in its own alone (`contacts`). And where every window begins anew at the same moment, all of them gain at
that one, and fall off on both sides; physics that is missing gains hardly less a second sooner or later.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float
from scipy.special import chdtri

from fidim_lab.data.records import Window
from fidim_lab.mismatch.cleaning.contacts import Contact, at_the_same_time
from fidim_lab.mismatch.cleaning.restarts import Parts, left_outside, made_good, pairs_of, parts_of, shortest, taken
from fidim_lab.mismatch.cleaning.segments import Segmented
from fidim_lab.mismatch.cleaning.thresholds import CLEANING
from fidim_lab.mismatch.fitting.refit import Completed
from fidim_lab.mismatch.residuals.whiteness import whiteness
from fidim_lab.mismatch.thresholds import SHARED


def find_common_push(model: Completed, held: Sequence[Window]) -> tuple[Contact, ...]:
    """A contact in every window, at the same time in each; none where nothing shows that.

    model: the best without a hand. held: held-out windows.
    """
    level = whiteness(model.leftovers).level
    windows = {window.id: window for window in held}
    windows |= {recording.window.id: recording.window for recording in model.fit.likelihood.recordings}
    parts = parts_of(model, held, set(windows))
    if not parts:
        return ()
    return at_the_same_time([_segmented(windows[id], one, level) for id, one in parts.items()]) or _at_one_moment(
        parts, level
    )


def _segmented(window: Window, one: Parts, level: float) -> Segmented:
    """A window's segments, each with a start of its own and the lengths that the motors hold left free."""
    edges = np.arange(0, len(one.t), round(CLEANING.segment / CLEANING.timed))
    grams = np.diff(one.grams[edges], axis=0)
    dof = np.maximum(np.diff(one.count[edges]) - one.kept.shape[1], 1).astype(float)
    left = grams[:, -1, -1] - taken(grams[:, :-1, :-1], grams[:, :-1, -1])
    return Segmented(window, one.t[edges], left / (level**2 * dof), dof)


def _at_one_moment(parts: Mapping[str, Parts], level: float) -> tuple[Contact, ...]:
    """Where all windows of one length gain by a new start at one moment, and clearly less a second away from it."""
    alike = max(({id: one for id, one in parts.items() if _alike(one, other)} for other in parts.values()), key=len)
    if len(alike) < max(CLEANING.contacts_pooled, len(parts) / 2):
        return ()
    first = next(iter(alike.values()))
    pairs = pairs_of(first)
    if not len(pairs):
        return ()
    lefts = np.array([left_outside(one, pairs) for one in alike.values()]) / level**2
    single, double = lefts.sum(axis=0)
    inside = np.sum([one.count[pairs[:, 1]] - one.count[pairs[:, 0]] for one in alike.values()], axis=0)
    more = sum(one.kept.shape[1] for one in alike.values())
    if (single - double).max() < chdtri(more, SHARED.chance / len(pairs)):
        return ()
    times = first.t[pairs]
    moment = _moment(times, single - double - more)
    if moment is None:
        return ()
    about = np.flatnonzero((times[:, 0] <= moment) & (times[:, 1] >= moment))
    best = about[shortest(double[about], inside[about])]
    free = sum(int(one.count[-1]) for one in alike.values()) - int(inside[best])
    if not made_good(double[best], free):
        return ()
    begin, end = (float(first.t[k] - first.t[0]) for k in pairs[best])
    return tuple(
        Contact(
            id,
            round(float(one.t[0]) + begin - CLEANING.timed, 2),
            round(float(one.t[0]) + end + CLEANING.timed, 2),
            float(before / after),
            CLEANING.timed,
            float(before - after),
        )
        for (id, one), (before, after) in zip(alike.items(), lefts[:, :, best], strict=True)
    )


def _alike(one: Parts, other: Parts) -> bool:
    """Whether both are as long."""
    return len(one.t) == len(other.t)


def _moment(times: Float[np.ndarray, "P 2"], gain: Float[np.ndarray, " P"]) -> float | None:
    """When a new start at one time (s) gains most, beyond chance; None where that is the top of a smooth hill."""
    single = times[:, 0] == times[:, 1]
    at, gain = times[single, 0], gain[single]
    top = int(np.argmax(gain))
    far = np.abs(at - at[top]) >= CLEANING.free
    if not far.any():
        return None
    hill = (2 * CLEANING.free / (at[-1] - at[0])) ** 2
    sharp = gain[top] - gain[far].max() > max(
        CLEANING.restarts_much_more, CLEANING.common_push_sharper * hill * gain[top]
    )
    return float(at[top]) if sharp else None
