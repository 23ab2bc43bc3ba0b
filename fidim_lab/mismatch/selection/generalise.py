"""More general forms of a term, tried where its simple form leaves structure in the residual."""

from collections.abc import Callable, Sequence
from functools import partial

from fidim_lab.effects.effect import NamedEffect
from fidim_lab.identification.mle.starts.springs import stretches
from fidim_lab.mismatch.fitting.baseline import Baseline
from fidim_lab.mismatch.fitting.refit import Completed, refit
from fidim_lab.mismatch.fitting.sprung import left_at_first
from fidim_lab.mismatch.linearised.hypotheses import Hypothesis, general
from fidim_lab.mismatch.selection.candidates import best_of, most_convincing
from fidim_lab.mismatch.selection.confounders import in_place_of
from fidim_lab.mismatch.thresholds import SHARED
from fidim_lab.model.side_by_side import found_side_by_side


def widened(start: Baseline, model: Completed, new: Sequence[Hypothesis]) -> Completed:
    """With a more general form of a new term, or cables that ring, where the simple form leaves such structure."""
    if model.is_white:
        return model
    fresh = {term.effect for term in new}
    found = general_forms(start, model, fresh)
    if model.mechanism.quiet and any(stretches(effect) for effect in fresh) and left_at_first(model.leftovers):
        rung = refit(start.ground(model), model.fit, model.tried, model.thetas, start.context, ringing=True)
        found += [] if rung is None else [rung]
    return most_convincing(model, found)


def general_forms(start: Baseline, model: Completed, fresh: set[NamedEffect]) -> list[Completed]:
    """The model with wider forms of these effects, from the first seconds on: else they lose phase.

    None that ends at an edge of what it may be: what data ask for then lies between it and the simple form.
    """
    simple = model
    if model.whole:
        donor = model.fit if model.mechanism.springs else start.short  # springs would have to be found anew
        found = refit(start.short_ground, donor, model.tried, model.thetas, start.context)
        simple = model if found is None else found
    near = _over_first_seconds(start, simple, fresh)
    if model.whole and near:
        best = best_of(near)
        whole = refit(start.whole_ground, best.fit, best.tried, best.thetas, start.context, simpler=model)
        near = [] if whole is None else [whole]
    return [wide for wide in near if model.at_an_edge or not wide.at_an_edge]


def _over_first_seconds(start: Baseline, simple: Completed, fresh: set[NamedEffect]) -> list[Completed]:
    """Each wider form in the place of the simple one, as far as it was found: it leaves no more then."""
    fits: list[Callable[[], Completed | None]] = []
    for k, term in enumerate(simple.tried):
        forms = term.effect.wider(simple.thetas[k], simple.mechanism.robot) if term.effect in fresh else ()
        for effect, begin in start.tried.admitted(forms):
            wider = general(term, effect, begin)
            fits.append(partial(in_place_of, simple, k, wider, begin, start.short_ground, start.context))
    return [wide for wide in found_side_by_side(fits) if wide.excess <= SHARED.little * simple.excess]
