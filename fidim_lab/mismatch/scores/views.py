"""A model with the scores of all effects that it does not have: what could be added to it."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fidim_lab.effects.effect import NamedEffect
from fidim_lab.effects.plausibility import Context
from fidim_lab.identification.mle.fit import Fit
from fidim_lab.identification.mle.trajectories.stages import HORIZONS
from fidim_lab.mismatch.fitting.fit_data import nearer
from fidim_lab.mismatch.fitting.refit import Completed
from fidim_lab.mismatch.linearised.columns import frequency_of
from fidim_lab.mismatch.linearised.columns_sprung import scorer_of
from fidim_lab.mismatch.linearised.hypotheses import PERIODIC, Hypotheses, Hypothesis
from fidim_lab.mismatch.scores.frequencies import between, likely_frequencies
from fidim_lab.mismatch.scores.own_phase import own_phase_scores
from fidim_lab.mismatch.scores.score import (
    Projected,
    Score,
    pair_scores,
    projected,
    single_scores,
    window_grams,
)
from fidim_lab.mismatch.scores.thresholds import SCORES
from fidim_lab.mismatch.thresholds import SHARED


@dataclass(frozen=True, eq=False)
class View:
    """All scores at one model, over a time in which it follows the motion."""

    model: Completed
    projected: Projected
    singles: tuple[Score, ...]
    """the most evident first; none where the model is so wrong that nothing can be said to first order"""
    context: Context
    fit: Fit
    """of the model, over the time that was looked at"""

    @property
    def races(self) -> bool:
        """Whether additions are tried over this time first: it is less than the model was fitted to, and short to fit.

        Cables that stretch find their own way from short recordings to long ones.
        """
        return self.fit is not self.model.fit and not self.model.mechanism.springs

    @property
    def rest(self) -> float:
        """χ² beyond that of the noise which the residuals show."""
        return _rest_of(self.projected, self.model)

    @property
    def pairs(self) -> tuple[Score, ...]:
        """The most evident first; computed anew at each call."""
        return pair_scores(self.projected, self.context)

    def additions(self, room: int) -> tuple[Score, ...]:
        """What is worth fitting beside the model: the best of each effect, then pairs that say more than any alone.

        room: for so many more terms; a periodic one that is in may move, to another frequency or to own phases, without
        any. Where the motion is followed the scores are all but exact, and only ties are fitted; else what has half as
        much.
        """
        singles = self._singles(room)
        pairs: list[Score] = []
        if room > 1 and singles:
            least = singles[0].log_evidence + SHARED.enough
            pairs = list(_varied([pair for pair in self.pairs if pair.log_evidence > least]))[: SHARED.leaders]
        return (*self._near(singles, 0.0), *self._near(pairs, singles[0].gain if singles else 0.0))

    def _singles(self, room: int) -> list[Score]:
        """The best of each effect, as many as may be fitted."""
        chosen: dict[object, Score] = {}
        inside = {h.effect.id for h in self.model.tried if h.effect.id in PERIODIC}
        for score in self.singles:
            allowed = room > 0 or score.tried[0].effect.id in inside
            if allowed and score.log_evidence > SHARED.enough:
                chosen.setdefault(score.tried[0].effect, score)
        if not self.races:
            return list(chosen.values())[: SHARED.leaders]
        counts = Counter[str]()
        varied: list[Score] = []
        for score in chosen.values():
            id = score.tried[0].effect.id
            counts[id] += 1
            varied += [score] if counts[id] <= SHARED.runners_up else []
        return [score for k, score in enumerate(varied) if k < SHARED.shortlist or score.tried[0].has_scan]

    def _near(self, scores: Sequence[Score], less: float) -> tuple[Score, ...]:
        """Those that come near the first; `less`: χ² that fewer terms take."""
        if not scores:
            return ()
        best = scores[0].log_evidence
        if self.model.excess >= SHARED.near:
            least = best * (SHARED.nearly if self.races else SHARED.half)
            return tuple(score for score in scores if score.log_evidence >= least)
        least = best - SCORES.views_tie - SHARED.slight * best
        return tuple(score for score in scores if score.log_evidence >= least and self._takes_enough(score, less))

    def _takes_enough(self, score: Score, less: float) -> bool:
        """Whether noise alone would be left, or at least a good part of what fewer terms leave would be gone."""
        fit, dof = self.model.fit, self.projected.dof
        noise = 4 * float(np.hypot(fit.noise_ratio**2 * np.sqrt(2 * dof), fit.noise_doubt * dof))
        return score.gain - less > SHARED.some * (self.rest - less) or self.rest - score.gain < noise


def view(model: Completed, tried: Hypotheses, context: Context) -> View:
    """The scores at a model, over as long a time as it follows the motion."""
    found = _followed(model.fit)
    seconds = float(found.journey.ends.max())
    # in a few seconds a tone at any phase passes for much of what other effects leave, but not for nearly all of it
    anyhow = not model.tried or (model.whole and found is model.fit)
    heard = _ANYHOW if anyhow else _Heard(SCORES.by_a_tone, SCORES.views_periods / seconds)
    return _seen(model, found, _without(tried, model.tried), context, heard)


def tones(model: Completed, tried: Hypotheses, context: Context) -> View:
    """The scores of steady tones alone over whole windows, however much the model leaves of these.

    First-order statements are worth little there, but for a tone with a phase of each window: it is what no few seconds
    tell, and what nothing but itself takes away.
    """
    left = replace(_without(tried, model.tried), direct=())
    return _seen(model, model.fit, left, context, _ANYHOW)


@dataclass(frozen=True)
class _Heard:
    """Which tones with a phase of each window are."""

    share: float
    """of what is left, that they take at least"""
    frequency: float
    """Hz, at least"""


_ANYHOW = _Heard(0.0, 0.0)


def _seen(model: Completed, found: Fit, left: Hypotheses, context: Context, heard: _Heard) -> View:
    """The scores of what is left to be tried at a fit of the model."""
    scan, leftovers = sorted({frequency_of(h) for h in left.periodic}), Completed((), found, whole=False).leftovers
    likely = likely_frequencies(leftovers, scan)
    left = replace(left, periodic=tuple(h for h in left.periodic if frequency_of(h) in likely))
    seen, singles = _scored(model, found, left, context, heard)
    least = max(SHARED.enough, SHARED.half * singles[0].log_evidence) if singles else SHARED.enough
    evident = [one for one in singles if one.tried[0].effect.id in PERIODIC and one.log_evidence > least]
    finer = between(left.periodic, evident, float(found.journey.ends.max()))
    if finer:
        fine = replace(left, direct=(), periodic=finer)
        singles = _sorted((*singles, *_scored(model, found, fine, context, heard)[1]))
    return View(model, seen, singles, context, found)


def _scored(
    model: Completed, found: Fit, left: Hypotheses, context: Context, heard: _Heard
) -> tuple[Projected, tuple[Score, ...]]:
    scored = scorer_of(model.mechanism, left)
    grams = window_grams(scored, found.likelihood, found.journey.optimum.simulation)
    seen = projected(scored, found, grams)
    same = single_scores(seen, context)
    own = _own_phase(same, own_phase_scores(seen, grams, model.mechanism.robot), model)
    least = heard.share * _rest_of(seen, model)
    own = (one for one in own if one.gain > least and frequency_of(one.tried[0]) >= heard.frequency)
    return seen, _sorted((*same, *own))


def _sorted(scores: Sequence[Score]) -> tuple[Score, ...]:
    """The most evident first."""
    return tuple(sorted(scores, key=lambda score: -score.log_evidence))


def _rest_of(seen: Projected, model: Completed) -> float:
    """χ² beyond that of the noise which the residuals show."""
    return seen.left - model.fit.noise_ratio**2 * seen.dof


def _own_phase(same: Sequence[Score], own: Sequence[Score], model: Completed) -> tuple[Score, ...]:
    """Tones with a phase of each window, where they say more than the same ones with one phase."""
    inside = {h.effect.id for h in model.tried if h.effect.of_each_window}
    least: dict[str, float] = {}
    for score in same:
        least.setdefault(score.tried[0].effect.id, score.log_evidence + SHARED.enough)
    found: list[Score] = []
    for score in own:
        effect = score.tried[0].effect
        evident = score.log_evidence > least.get(effect.id, SHARED.enough)
        if evident and effect.id not in inside:
            found.append(score)
    return tuple(found)


def _followed(found: Fit) -> Fit:
    """The fit of as long a part of the windows as the model follows."""
    for seconds in (HORIZONS[2], HORIZONS[1]):
        longest = max(recording.end for recording in found.likelihood.recordings)
        if found.excess < SHARED.near or longest <= seconds:
            continue
        short = nearer(found, seconds)
        found = found if short is None else short
    return found


def _varied(pairs: Sequence[Score]) -> tuple[Score, ...]:
    """The best pair, and others that do not share its first effect's every rival: at most two with the same effect."""
    counts: dict[object, int] = {}
    chosen: list[Score] = []
    for pair in pairs:
        if all(counts.get(h.effect, 0) < 2 for h in pair.tried):
            chosen.append(pair)
            for h in pair.tried:
                counts[h.effect] = counts.get(h.effect, 0) + 1
    return tuple(chosen)


def _without(tried: Hypotheses, used: Sequence[Hypothesis]) -> Hypotheses:
    """All but what the model has, and other variants of it; a periodic term may be there at a wrong frequency."""
    effects, kinds = {h.effect for h in used}, {(h.effect.id, h.effect.cable): type(h.effect) for h in used}

    def is_variant(effect: NamedEffect) -> bool:
        return kinds.get((effect.id, effect.cable), type(effect)) is not type(effect)

    return replace(
        tried,
        direct=tuple(h for h in tried.direct if h.effect not in effects and not is_variant(h.effect)),
        periodic=tuple(h for h in tried.periodic if not is_variant(h.effect)),
    )
