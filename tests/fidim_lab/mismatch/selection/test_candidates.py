"""When a model with another term is taken: held-out windows, and how much of what is left it takes."""

from collections.abc import Callable

import pytest

from fidim_lab.mismatch.fitting.refit import evidence
from fidim_lab.mismatch.selection.candidates import Candidate, evidence_of_all, improves


@pytest.fixture
def judged(claim: Callable[..., Candidate]) -> Callable[..., Candidate]:
    """By held-out windows and by what is left of all of them; nothing is left where the excess is 0."""

    def made(chi2_per_dof: float, excess: float, dof: int = 1000) -> Candidate:
        return claim(held_out=chi2_per_dof, held_dof=dof, excess=excess, white=excess == 0.0)

    return made


@pytest.mark.parametrize(
    ("before", "after", "taken", "taken_if_feeble"),
    [
        ((7.0, 5000.0), (4.0, 2000.0), True, True),
        ((7.0, 5000.0), (5.3, 4200.0), False, True),  # a tone that is not in yet drowns it in whole windows
        ((7.0, 5000.0), (7.1, 2000.0), False, False),
        ((1.1, 50.0), (1.0, 0.0), True, True),
        ((1.1, 50.0), (1.2, 0.0), False, False),
        ((1.1, 50.0), (1.2, 0.0, 900), True, True),  # of what makes all white, one window may be followed less far
        ((1.0, 0.0), (1.01, 0.0), False, False),
    ],
    ids=[
        "a good part",
        "a small part",
        "held out worse",
        "all",
        "all, held out worse",
        "all, less followed",
        "nothing to take",
    ],
)
def test_what_is_taken(judged, before, after, taken, taken_if_feeble):
    best, fresh = judged(*before), judged(*after)
    assert improves(fresh, best) == taken
    assert improves(fresh, best, feeble=True) == taken_if_feeble


def test_evidence_of_all_windows_counts_those_held_out_where_both_follow_them_as_far(claim: Callable[..., Candidate]):
    better, worse = claim(fitted=1.01, held_out=1.0, held_dof=1000), claim(fitted=1.0, held_out=1.2, held_dof=1000)
    alone = evidence(better.model, worse.model, 1.0)
    assert alone < 0.0
    assert evidence_of_all(better, worse, 1.0) == pytest.approx(alone + 100.0)
    assert evidence_of_all(better, worse, 2.0) == pytest.approx(evidence(better.model, worse.model, 2.0) + 50.0)
    astray = claim(fitted=1.01, held_out=10.0, held_dof=1000), claim(fitted=1.0, held_out=12.0, held_dof=1000)
    assert evidence_of_all(*astray, 1.0) == pytest.approx(alone + 100.0)  # of what both miss by far a unit is no nat
    less_followed = claim(fitted=1.0, held_out=1.2, held_dof=900)
    assert evidence_of_all(better, less_followed, 1.0) == pytest.approx(alone)
