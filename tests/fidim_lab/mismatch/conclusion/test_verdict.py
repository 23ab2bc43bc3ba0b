"""What is concluded from what a search leaves: names only where they are more than stand-ins."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.effects.catalogue import by_id
from fidim_lab.effects.effect import UnknownEffect
from fidim_lab.mismatch.conclusion.explanation import Verdict
from fidim_lab.mismatch.conclusion.message import best_of_all
from fidim_lab.mismatch.conclusion.verdict import judge
from fidim_lab.mismatch.fitting.baseline import Baseline
from fidim_lab.mismatch.linearised.hypotheses import Hypothesis
from fidim_lab.mismatch.selection.candidates import Candidate
from fidim_lab.mismatch.selection.select import Selection

Verdicts = Callable[..., Verdict]


@pytest.fixture(scope="module")
def verdict(claim: Callable[..., Candidate], searched: Selection) -> Verdicts:
    """Of a search that ended at a model with these effects and figures, in which much was missing before."""

    def said(*tried: Hypothesis, held_out: float, fitted: float | None = None, **figures: float) -> Verdict:
        best = claim(*tried, held_out=held_out, fitted=held_out if fitted is None else fitted, **figures)
        found = replace(searched, best=best, baseline=claim(excess=1e5, fitted=3.0, held_out=3.0))
        judged = judge(found)
        assert judged.known == (judged.named is best)
        return judged.verdict

    return said


@pytest.fixture(scope="module")
def drag(quiet: Baseline) -> Hypothesis:
    return next(h for h in quiet.tried.direct if h.effect.id == "air-drag-quadratic")


@pytest.fixture(scope="module")
def tone(quiet: Baseline) -> Hypothesis:
    """With a phase of its own in every window."""
    effect = next(one for one in by_id(quiet.campaign.robot, "periodic-force") if one.of_each_window)
    return Hypothesis(effect, np.zeros(len(effect.parameters)), (0, 1, 2))


def test_white_is_explained_or_nothing(verdict: Verdicts, drag: Hypothesis) -> None:
    assert verdict(drag, drag, excess=30.0, held_out=1.0, white=True) is Verdict.EXPLAINED


def test_nothing_is_missing_where_the_model_as_it_is_leaves_noise(searched: Selection) -> None:
    assert judge(searched).verdict is Verdict.NOTHING_MISSING


@pytest.mark.parametrize(
    ("held_out", "said"),
    [
        (1.06, Verdict.EXPLAINED),  # the largest of honest campaigns with an open geometry
        (1.15, Verdict.PARTLY_EXPLAINED),
        (1.5, Verdict.UNKNOWN_PHYSICS),  # umbilical, constant and body-fixed force in place of a field of force
    ],
)
def test_what_its_own_errors_excuse_is_not_explained(
    verdict: Verdicts, drag: Hypothesis, held_out: float, said: Verdict
) -> None:
    assert verdict(drag, drag, drag, excess=30.0, held_out=held_out, fitted=1.0, white=True) is said


@pytest.mark.parametrize(
    ("left", "held_out", "held_dof", "said"),
    [
        (0.05, 1.05, 18_000, Verdict.PARTLY_EXPLAINED),  # little is left
        (0.05, 1.5, 18_000, Verdict.UNKNOWN_PHYSICS),  # as a sibling would leave
        (0.005, 1.5, 18_000, Verdict.PARTLY_EXPLAINED),  # a tenth of the millimetres: no sibling does that
        (0.2, 1.05, 18_000, Verdict.UNKNOWN_PHYSICS),
        (0.05, 1.5, 0, Verdict.UNKNOWN_PHYSICS),  # no window held out: the fitted windows say it
    ],
)
def test_a_stand_in_is_no_part_of_the_truth(
    verdict: Verdicts, drag: Hypothesis, left: float, held_out: float, held_dof: int, said: Verdict
) -> None:
    assert verdict(drag, excess=left * 1e5, held_out=held_out, held_dof=held_dof) is said


def test_a_tone_with_own_phases_is_named_where_nothing_stays_and_no_part_of_the_truth_else(
    verdict: Verdicts, tone: Hypothesis
) -> None:
    assert verdict(tone, excess=30.0, held_out=1.0, white=True) is Verdict.EXPLAINED
    assert verdict(tone, excess=200.0, held_out=1.04) is Verdict.UNKNOWN_PHYSICS


def test_what_is_pressed_as_far_as_is_possible_stands_in_for_something_else(
    verdict: Verdicts, drag: Hypothesis
) -> None:
    assert verdict(drag, excess=500.0, held_out=1.5, at_an_edge=True) is Verdict.UNKNOWN_PHYSICS
    assert verdict(drag, excess=500.0, held_out=1.05, at_an_edge=True) is Verdict.UNKNOWN_PHYSICS
    assert verdict(drag, excess=30.0, held_out=1.0, white=True, at_an_edge=True) is Verdict.EXPLAINED


def test_a_law_that_nothing_of_the_catalogue_has_is_unknown_however_well_it_fits(verdict: Verdicts) -> None:
    law = Hypothesis(UnknownEffect(), np.zeros(0), ())
    assert verdict(law, excess=30.0, held_out=1.0, white=True) is Verdict.UNKNOWN_PHYSICS


@pytest.mark.parametrize(
    ("evidence", "held_dof", "said"),
    [
        (-1.9, 900, "log-evidence -1.9 (5 would be needed)"),
        (41.0, 900, "log-evidence 41.0 on the fitted windows, but held-out"),
        (41.0, 0, "log-evidence 41.0 on the fitted windows, but does not explain enough of them"),
    ],
)
def test_what_the_fitted_windows_ask_for_and_others_refuse_is_said_to_be_that(
    searched: Selection, claim: Callable[..., Candidate], evidence: float, held_dof: int, said: str
) -> None:
    score = replace(searched.first.singles[0], log_evidence=evidence)
    found = replace(searched, first=replace(searched.first, singles=(score,)), baseline=claim(held_dof=held_dof))
    assert said in best_of_all(found)
    assert best_of_all(replace(searched, first=replace(searched.first, singles=()))) == ""
