"""Effects of much freedom against a wrench without a name, on campaigns of another simulator and case by case."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.data.records import Role
from fidim_lab.identification.mle.fit import Fit
from fidim_lab.mismatch.conclusion.explanation import Verdict
from fidim_lab.mismatch.conclusion.parsimony_check import unless_outdone
from fidim_lab.mismatch.conclusion.verdict import Judged
from fidim_lab.mismatch.fitting.baseline import Baseline
from fidim_lab.mismatch.fitting.holdout import HeldOut, predict
from fidim_lab.mismatch.fitting.refit import refit
from fidim_lab.mismatch.linearised.hypotheses import Hypothesis
from fidim_lab.mismatch.selection.candidates import Candidate, candidate
from fidim_lab.mismatch.selection.select import Selection
from fidim_lab.mismatch.unknown_force.family import Dependence
from fidim_lab.mismatch.unknown_force.unknown import Term, UnknownForce
from fidim_lab.model.mechanism import Mechanism


def judged(start: Baseline, searched: Selection, *ids: str) -> tuple[Judged, Selection]:
    """As if these effects had been named; and what a search would hand over."""
    tried = [next(h for h in start.tried.direct if h.effect.id == id) for id in ids]
    model = refit(start.whole_ground, start.as_it_is.fit, tried, [h.absent for h in tried], start.context)
    assert model is not None
    named = candidate(model, predict(model, start.held_out))
    return Judged(Verdict.EXPLAINED, named), replace(searched, baseline=candidate(start.as_it_is, start.predicted))


@pytest.mark.parametrize(
    ("hidden", "named", "wrench"),
    [
        ("unknown-gradient:k=1.5,x=1.2,y=-0.1,z=-0.3", ("umbilical", "constant-force"), Dependence.GRADIENT),
        ("umbilical:k=3,c=0.1,x=0.2,y=0.5,z=-1.0", ("umbilical", "constant-force"), None),
        ("unknown-cubic:c=3", ("air-drag-quadratic", "swivel-damping"), Dependence.SPEED),
        ("air-drag-quadratic:c=1", ("air-drag-quadratic", "swivel-damping"), None),
    ],
    ids=["a saddle of force", "a hose", "drag of the speed cubed", "drag of its square"],
)
@pytest.mark.slow
def test_what_a_simple_wrench_says_better_is_not_named(
    baseline_of, searched, hidden: str, named: tuple[str, str], wrench: Dependence | None
) -> None:
    start = baseline_of(hidden, seed=3, windows=6, seconds=3.0)
    said: list[str] = []
    claim, found = judged(start, searched, *named)
    after = unless_outdone(claim, found, start.campaign, said.append)
    assert said == [f"modelling one unknown force in place of {claim.named.model.label}"]
    if wrench is None:
        assert after is claim
    else:
        assert after.verdict is Verdict.UNKNOWN_PHYSICS
        assert after.named is found.baseline
        assert after.outdone_by is not None
        assert after.outdone_by.terms[0].dependence is wrench


HELD = 9_000
"""χ² of held-out windows, as many numbers"""
TERM = Term("one", Dependence.SPEED, None, 3.0, (), (), True)


@pytest.fixture
def terms(quiet: Baseline) -> Callable[..., tuple[Hypothesis, ...]]:
    return lambda *ids: tuple(next(h for h in quiet.tried.direct if h.effect.id == id) for id in ids)


@pytest.fixture
def wrench_of(quiet: Baseline, fit_with: Callable[..., Fit]) -> Callable[..., UnknownForce]:
    """With so many parameters, and so much less χ² than a fit that leaves noise, of fitted and held-out windows."""

    def made(parameters: int, gained: float, foretold: float, fitted: float) -> UnknownForce:
        after = HeldOut(HELD - foretold, HELD, 1e-4, {})
        fit = fit_with(np.zeros(parameters), fitted - gained)
        return UnknownForce((TERM,), 0.9, quiet.predicted, after, (), None, (), (), fit, 1.0)

    return made


@pytest.fixture
def outdone(quiet: Baseline, searched: Selection, wrench_of: Callable[..., UnknownForce]) -> Callable[..., bool]:
    """Whether a wrench with so many parameters and gains outdoes what is claimed."""

    def made(named: Candidate, parameters: int, gained: float, foretold: float, chi2: float | None = None) -> bool:
        rival = wrench_of(parameters, gained, foretold, named.model.chi2 if chi2 is None else chi2)
        found = replace(searched, alone=rival)
        after = unless_outdone(Judged(Verdict.EXPLAINED, named), found, quiet.campaign, pytest.fail)
        return after.outdone_by is rival

    return made


@pytest.mark.parametrize(
    ("parameters", "gained", "foretold", "outdone_by_it"),
    [
        (4, 40.0, 40.0, True),
        (4, 40.0, 4.0, False),  # held-out windows do not agree
        (4, 4.0, 40.0, False),
        (9, 40.0, 40.0, False),  # more freedom, which may gain as much by chance
        (1, -16.0, 40.0, True),  # less
    ],
)
def test_freedom_is_paid_for_and_held_out_windows_must_agree(
    terms, claim, outdone, parameters: int, gained: float, foretold: float, outdone_by_it: bool
) -> None:
    named = claim(*terms("constant-force", "air-drag-quadratic"), held_dof=HELD)
    assert sum(len(one.effect.parameters) for one in named.model.tried) == 4
    assert outdone(named, parameters, gained, foretold) is outdone_by_it


def test_what_named_effects_lose_is_charged_like_the_rest(terms, claim, outdone) -> None:
    two = terms("constant-force", "air-drag-quadratic")
    all_of_it = claim(*two, held_dof=HELD)
    half = claim(*two, held_dof=HELD, dof=10_500, fitted=2.0)  # with the χ² of all windows in half of them
    assert outdone(half, 4, 0.0, 40.0, all_of_it.model.chi2)
    assert not outdone(all_of_it, 4, 0.0, 40.0)


@pytest.mark.parametrize(
    ("ids", "verdict", "springs", "held"),
    [
        (("umbilical", "constant-force"), Verdict.UNKNOWN_PHYSICS, False, True),
        (("umbilical", "constant-force"), Verdict.EXPLAINED, True, True),
        (("umbilical", "constant-force"), Verdict.EXPLAINED, False, False),
        (("umbilical",), Verdict.EXPLAINED, False, True),
    ],
    ids=["nothing is named", "cables stretch", "nothing is held out", "one effect of few parameters"],
)
def test_nothing_is_modelled_where_there_is_nothing_to_doubt_or_to_judge_by(
    quiet, searched, terms, claim, ids: tuple[str, ...], verdict: Verdict, springs: bool, held: bool
) -> None:
    named = claim(*terms(*ids))
    if springs:
        likelihood = named.model.fit.likelihood
        made = Mechanism(quiet.campaign.robot, springs=True)
        fit = replace(named.model.fit, likelihood=replace(likelihood, mechanism=made))
        named = replace(named, model=replace(named.model, fit=fit))
    campaign = quiet.campaign if held else replace(quiet.campaign, windows=quiet.campaign.of_role(Role.IDENTIFY))
    judged = Judged(verdict, named)
    assert unless_outdone(judged, searched, campaign, pytest.fail) is judged
