"""Times at which a window's motion starts again: a matched test for pushes that `contacts` cannot find.

After a push the platform moves freely again, from another state. To first order what is left of the window is then
J d before it and J d' after it, with the cables as long as before: a least-squares fit with two starts, not one,
of which the gain in χ² by chance is known (Wilks). It needs a model that follows all but a few windows: where more
begin anew, where what the others leave is not white, or where two starts do not make good a window either, something
acts that is not a hand, and nothing is cut. Nor is it where a new start does nearly as well at any other time: a hand
has its moment, while a little physics that is missing goes on for the whole of a window, and shows in that one only
because its motion magnifies it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy.linalg import null_space
from scipy.special import chdtri

from fidim_lab.data.records import Window
from fidim_lab.identification.mle.trajectories.likelihood import Likelihood, Simulation, WindowLinear, linearised
from fidim_lab.mismatch.cleaning.contacts import Contact
from fidim_lab.mismatch.cleaning.thresholds import CLEANING
from fidim_lab.mismatch.fitting.holdout import HeldOut, predictions
from fidim_lab.mismatch.fitting.refit import Completed
from fidim_lab.mismatch.residuals.residual import Leftover
from fidim_lab.mismatch.residuals.whiteness import whiteness
from fidim_lab.mismatch.thresholds import SHARED

UNSEEN = 1e-11
"""of the largest eigenvalue of scaled normal equations, below which a direction is not seen at all"""


@dataclass(frozen=True, eq=False)
class Parts:
    """The normal equations of one window from its begin up to each time of the grid, and those of what is not timed."""

    t: Float[np.ndarray, " K"]
    """s on the window's own clock"""
    count: Int[np.ndarray, " K"]
    """numbers recorded so far; all of them at the last"""
    grams: Float[np.ndarray, "K own+1 own+1"]
    """of [J_own r]"""
    whole: Float[np.ndarray, "own+1 own+1"]
    """the same of all samples"""
    untimed: Float[np.ndarray, "own+1 own+1"]
    """the same of lengths and priors"""
    kept: Float[np.ndarray, "own s"]
    """changes of the start with which every cable stays as long as it is"""


def find_pushes(model: Completed, predicted: HeldOut, held: Sequence[Window]) -> tuple[Contact, ...]:
    """Every push, one a window, where the windows that were not pushed are white; none where nothing shows that.

    model: the best. predicted, held: what it leaves of held-out windows, and these windows.
    """
    leftovers = (*model.leftovers, *predicted.leftovers)
    odd = _odd(leftovers)
    if not odd:
        return ()
    level = whiteness([one for one in leftovers if one.window not in odd]).level
    parts = parts_of(model, [window for window in held if window.id in odd], odd)
    pairs = len(leftovers) * max((len(pairs_of(one)) for one in parts.values()), default=0)
    if not pairs:
        return ()  # too short for two starts
    pushed = [_push(id, one, level, SHARED.chance / pairs) for id, one in parts.items()]
    seen = tuple(contact for contact in pushed if contact is not None)
    return seen if len(seen) == len(odd) else ()


def _odd(leftovers: Sequence[Leftover]) -> set[str]:
    """The few windows without which the others are white; none where all are, or where it would take many."""
    if whiteness(leftovers).is_white:
        return set()
    chances = {one.window: whiteness([one]).p_value for one in leftovers}
    worst = sorted(chances, key=lambda id: chances[id])
    for few in range(1, max(1, int(SHARED.few * len(leftovers))) + 1):
        odd = set(worst[:few])
        if whiteness([one for one in leftovers if one.window not in odd]).is_white:
            return odd
    return set()


def parts_of(model: Completed, held: Sequence[Window], wanted: set[str]) -> dict[str, Parts]:
    """Of the windows that are wanted, fitted or held out, and that are followed to their ends."""
    likelihood, journey = model.fit.likelihood, model.fit.journey
    ids = [recording.window.id for recording in likelihood.recordings]
    fitted = [w for w, id in enumerate(ids) if id in wanted and w not in journey.lost]
    parts = _all_parts(likelihood, journey.optimum.simulation, fitted) if fitted else {}
    for _, prediction in predictions(model.fit, held).found if held else ():
        if not prediction.lost:
            parts |= _all_parts(prediction.likelihood, prediction.journey.optimum.simulation, [prediction.place])
    return parts


def _all_parts(likelihood: Likelihood, simulation: Simulation, wanted: Sequence[int]) -> dict[str, Parts]:
    """Of recordings by their places, with their windows' ids."""
    ids = [recording.window.id for recording in likelihood.recordings]
    found = (one for one in linearised(likelihood, simulation) if one.window in wanted)
    return {ids[one.window]: _parts(likelihood, simulation, one) for one in found}


def _parts(likelihood: Likelihood, simulation: Simulation, linear: WindowLinear) -> Parts:
    w, recording = linear.window, likelihood.recordings[linear.window]
    use, seen = recording.seen_until(simulation.ends[w])
    rows = np.column_stack([linear.by_own, linear.residual])
    timed, untimed = rows[: int(seen.sum())], rows[int(seen.sum()) :]
    t = recording.t[use]
    grid = np.arange(0.0, float(t[-1]) + CLEANING.timed, CLEANING.timed)
    of_sample = np.repeat(t, seen.sum(axis=(1, 2)))
    cell = np.searchsorted(grid, of_sample, side="right") - 1
    cells = [timed[cell == k] for k in range(len(grid))]
    grams = np.cumsum([np.zeros((rows.shape[1],) * 2), *(one.T @ one for one in cells)], axis=0)[:-1]
    count = np.cumsum([0, *(len(one) for one in cells)])[:-1]
    kept = null_space(simulation.starts.lengths_by[w][:, : linear.by_own.shape[1]])
    whole = timed.T @ timed
    return Parts(recording.window.t[0] + recording.begin + grid, count, grams, whole, untimed.T @ untimed, kept)


def pairs_of(one: Parts) -> Int[np.ndarray, "P 2"]:
    """Places on the grid where a push may begin and end."""
    first, last = one.t[0] + CLEANING.beside, one.t[-1] - CLEANING.beside
    begin, end = np.nonzero(
        (one.t[:, np.newaxis] >= first)
        & (one.t <= last)
        & (one.t >= one.t[:, np.newaxis])
        & (one.t <= one.t[:, np.newaxis] + CLEANING.restarts_longest)
    )
    return np.column_stack([begin, end])


def _push(id: str, one: Parts, level: float, chance: float) -> Contact | None:
    """The push of one window; None where a second start gains no more than chance would, or has no moment."""
    pairs = pairs_of(one)
    if not len(pairs):
        return None
    single, double = (left / level**2 for left in left_outside(one, pairs))
    gain = single - double
    if gain.max() < chdtri(one.kept.shape[1], chance):
        return None
    inside = one.count[pairs[:, 1]] - one.count[pairs[:, 0]]
    best = shortest(double, inside)
    free = one.count[-1] - inside[best]
    if not made_good(double[best], free):
        return None
    times = one.t[pairs]
    if not _has_its_moment(times, double + inside, best):
        return None
    begin, end = (float(t) for t in times[best])
    ratio = float(single[best] / double[best])
    return Contact(
        id,
        round(begin - CLEANING.timed, 2),
        round(end + CLEANING.timed, 2),
        ratio,
        CLEANING.timed,
        float(gain.max()),
    )


def made_good(chi2: float, free: int) -> bool:
    """Whether χ² with two starts is what noise leaves, or nearly."""
    return chi2 <= free + SHARED.certain * np.sqrt(2.0 * free)


def left_outside(one: Parts, pairs: Int[np.ndarray, "P 2"]) -> tuple[Float[np.ndarray, " P"], Float[np.ndarray, " P"]]:
    """χ² of what is outside each pair of times, with one start and with two."""
    before, after = one.grams[pairs[:, 0]], one.whole - one.grams[pairs[:, 1]]
    outer = before + after + one.untimed
    shift = one.kept.T @ after[:, :-1]  # P, s, own + 1
    both = np.concatenate(
        [
            np.concatenate([outer[:, :-1, :-1], np.swapaxes(shift[..., :-1], 1, 2)], axis=2),
            np.concatenate([shift[..., :-1], one.kept.T @ after[:, :-1, :-1] @ one.kept], axis=2),
        ],
        axis=1,
    )
    right = np.concatenate([outer[:, :-1, -1], shift[..., -1]], axis=1)
    single = outer[:, -1, -1] - taken(outer[:, :-1, :-1], outer[:, :-1, -1])
    return single, outer[:, -1, -1] - taken(both, right)


def _has_its_moment(times: Float[np.ndarray, "P 2"], whole: Float[np.ndarray, " P"], best: int) -> bool:
    """Whether a new start far from the best pair leaves much more than there.

    times: begin and end of each pair, s. whole: χ² with two starts, what is between them being noise.
    """
    (begin, end), at = times[best], times[:, 0]
    far = (times[:, 0] == times[:, 1]) & ((at <= begin - CLEANING.free) | (at >= end + CLEANING.free))
    return not far.any() or whole[far].min() - whole[best] > CLEANING.restarts_much_more


def shortest(left: Float[np.ndarray, " P"], inside: Int[np.ndarray, " P"]) -> int:
    """Of the pairs that leave, with noise alone between them, as little as the best but for chance, the closest."""
    whole = left + inside
    best = int(np.argmin(whole))
    chance = CLEANING.restarts_certain * np.sqrt(2.0 * np.maximum(inside[best] - inside, 0))
    near = np.flatnonzero(whole <= whole[best] + chance)
    return int(near[np.argmin(inside[near])])


def taken(normal: Float[np.ndarray, "P m m"], right: Float[np.ndarray, "P m"]) -> Float[np.ndarray, " P"]:
    """χ² that the best solution of each system takes off; what the data do not see at all stays where it is."""
    scale = 1 / np.sqrt(np.maximum(np.diagonal(normal, axis1=1, axis2=2), 1e-300))
    values, vectors = np.linalg.eigh(normal * scale[:, :, np.newaxis] * scale[:, np.newaxis])
    along = (np.swapaxes(vectors, 1, 2) @ (right * scale)[..., np.newaxis])[..., 0]
    seen = values > UNSEEN * values[:, -1:]
    return (np.where(seen, along**2, 0.0) / np.where(seen, values, 1.0)).sum(axis=1)
