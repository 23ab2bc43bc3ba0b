"""Why a model that was tried is not the one that is named, as a line for people."""

import numpy as np

from fidim_lab.identification.mle.evidence import ODDS
from fidim_lab.mismatch.fitting.holdout import HeldOut
from fidim_lab.mismatch.fitting.refit import Completed, evidence
from fidim_lab.mismatch.scores.score import Score, score_together
from fidim_lab.mismatch.selection.candidates import Candidate, rank
from fidim_lab.mismatch.selection.select import Selection
from fidim_lab.mismatch.thresholds import SHARED
from fidim_lab.units import millimetres, percent

MOST_ODDS = 1000.0
"""stated as a number; beyond it the text says “over”"""
IMPOSSIBLE = "Its best fit is at the limit of what is possible, or beyond it."


def why_lost(rival: Candidate, named: Candidate, *, possible: bool) -> str:
    """Of a model that was fitted to whole windows; empty of the named one itself."""
    if rival is named:
        return ""
    name, figures = forms(named.model), _figures(rival.held_out, named.held_out)
    if not possible:
        return IMPOSSIBLE
    if named.is_white and not rival.is_white:
        return f"It leaves motion unexplained; {name} leaves only noise{figures}."
    behind = _behind(rival.model, named.model)
    if behind <= -ODDS:
        if rank(rival) >= rank(named):
            return f"It fits better than {name}, but predicts held-out windows no better{figures}."
        return f"It explains too little of what remains unexplained with {name}{figures}."
    return odds_against(behind, name, further=len(rival.model.tried) > len(named.model.tried))


def why_lost_early(rival: Completed, found: Selection, named: Candidate, *, possible: bool) -> str:
    """Of a model that was fitted to the first seconds alone: beside the named one there, or the best one."""
    if not possible:
        return IMPOSSIBLE
    key = names(named.model)
    there = [model for model in found.passing if names(model) == key]
    if named.is_white and not rival.is_white:
        return f"It leaves motion unexplained in the first seconds; {forms(named.model)} leaves only noise."
    if not there:
        return "Other models of the first seconds ranked above it."
    best = min(there, key=lambda model: model.chi2)
    behind = _behind(rival, best)
    if behind <= -ODDS:
        return f"It fits the first seconds better than {forms(best)}, which explains whole windows."
    return odds_against(behind, forms(best), further=len(rival.tried) > len(best.tried))


def why_not_fitted(score: Score, found: Selection, named: Candidate) -> str:
    """Of an effect that was only scored beside the model as it is, and beside the named one."""
    seen = found.first
    if score.log_evidence < SHARED.enough or seen.rest <= 0:
        return "It explains no more than it would of pure noise."
    of_all = f"Alone it explains {_percent(score.gain / seen.rest)} of the misfit"
    if not named.model.tried:
        return f"{of_all}."
    name, own = forms(named.model), _named_at_first(found, named)
    if own is None or score.gain >= own.gain:
        further = f"; {name} explains all but noise" if named.is_white else ""
        return f"{of_all}{further}{_beside(score, found, named)}."
    alone = f"{_percent(score.gain / own.gain)} of what {name} explains"
    behind = own.log_evidence - score.log_evidence
    odds = f", odds {_odds(behind)} to 1 against it" if behind > ODDS else ""
    return f"{alone}{odds}{_beside(score, found, named)}."


def odds_against(nats: float, name: str, *, further: bool) -> str:
    """Of a model that is so many nats less evident than the one of this name. further: it has more effects."""
    if nats > ODDS:
        return f"The odds are {_odds(nats)} to 1 for {name}."
    if further:
        return f"It explains no more than {name}, with more effects."
    return f"Not excluded: the odds for {name} are under {np.exp(ODDS):.0f} to 1."


def names(model: Completed) -> tuple[str, ...]:
    """Of its effects, in a fixed order: the same for the same effects."""
    return tuple(sorted(h.label for h in model.tried))


def forms(model: Completed) -> str:
    """Its effects with their forms, for people."""
    return " + ".join(h.effect.label for h in model.tried) or "nothing left out"


def _named_at_first(found: Selection, named: Candidate) -> Score | None:
    """The named effects as they were scored beside the model as it is; None where one of them was not."""
    seen, members = found.first, []
    for term in named.model.tried:
        alike = [one.tried[0] for one in seen.singles if one.tried[0].effect == term.effect]
        places = [k for k, one in enumerate(seen.projected.tried) if alike and one is alike[0]]
        if not places:
            return None
        members.append(places[0])
    return score_together(seen.projected, tuple(members), seen.context)


def _percent(share: float) -> str:
    return f"{percent(min(share, 1.0)):.0f} %"


def _odds(nats: float) -> str:
    return f"over {MOST_ODDS:.0f}" if nats > np.log(MOST_ODDS) else f"{np.exp(nats):.0f}"


def _beside(score: Score, found: Selection, named: Candidate) -> str:
    """Whether it adds anything beside the named effects, where that was looked at."""
    if found.last.model is not named.model:
        return ""
    effect = score.tried[0].effect
    more = [one.log_evidence for one in found.last.singles if one.tried[0].effect == effect]
    return "; nothing in addition to it" if more and max(more) < SHARED.enough else ""


def _figures(rival: HeldOut, named: HeldOut) -> str:
    if not (rival.dof and named.dof):
        return ""
    return f" (held out: {millimetres(rival.rms):.2g} mm against {millimetres(named.rms):.2g} mm)"


def _behind(rival: Completed, named: Completed) -> float:
    """Nats by which it is less evident; what the named model leaves counts as noise."""
    return evidence(named, rival, max(1.0, named.fit.chi2_per_dof))
