"""What is concluded from what a search leaves: names only where they are more than stand-ins."""

from types import SimpleNamespace

import pytest

from fidim_lab.mismatch.conclusion.explanation import Verdict
from fidim_lab.mismatch.conclusion.message import best_of_all
from fidim_lab.mismatch.conclusion.verdict import judge


def candidate(
    terms: int,
    excess: float,
    held_out: float,
    *,
    fitted: float | None = None,
    white: bool = False,
    windows: int = 6,
    own_phase: bool = False,
    at_an_edge: bool = False,
    id: str = "air-drag-quadratic",
):
    term = SimpleNamespace(effect=SimpleNamespace(of_each_window=own_phase, id=id))
    return SimpleNamespace(
        model=SimpleNamespace(
            tried=(term,) * terms,
            fit=SimpleNamespace(chi2_per_dof=held_out if fitted is None else fitted),
            at_an_edge=at_an_edge,
        ),
        held_out=SimpleNamespace(chi2_per_dof=held_out if windows else float("nan"), dof=3000 * windows),
        whiteness=SimpleNamespace(excess=excess),
        is_white=white,
    )


def verdict(best, before: float = 1e5):
    found = SimpleNamespace(best=best, baseline=candidate(0, before, 3.0), outdone=None)
    judged = judge(found)
    assert judged.known == (judged.named is best)
    return judged.verdict


def test_white_is_explained_or_nothing() -> None:
    assert verdict(candidate(2, 30.0, 1.0, white=True)) is Verdict.EXPLAINED
    assert judge(
        SimpleNamespace(
            best=candidate(0, 30.0, 1.0, white=True),
            baseline=candidate(0, 30.0, 1.0, white=True),
            outdone=None,
        )
    ).verdict is Verdict.NOTHING_MISSING  # fmt: skip


@pytest.mark.parametrize(
    ("held_out", "said"),
    [
        (1.06, Verdict.EXPLAINED),  # the largest of honest campaigns with an open geometry
        (1.15, Verdict.PARTLY_EXPLAINED),
        (1.5, Verdict.UNKNOWN_PHYSICS),  # umbilical, constant and body-fixed force in place of a field of force
    ],
)
def test_what_its_own_errors_excuse_is_not_explained(held_out: float, said: Verdict) -> None:
    assert verdict(candidate(3, 30.0, held_out, fitted=1.0, white=True)) is said


@pytest.mark.parametrize(
    ("left", "held_out", "windows", "said"),
    [
        (0.05, 1.05, 6, Verdict.PARTLY_EXPLAINED),  # little is left
        (0.05, 1.5, 6, Verdict.UNKNOWN_PHYSICS),  # as a sibling would leave
        (0.005, 1.5, 6, Verdict.PARTLY_EXPLAINED),  # a tenth of the millimetres: no sibling does that
        (0.2, 1.05, 6, Verdict.UNKNOWN_PHYSICS),
        (0.05, 1.5, 0, Verdict.UNKNOWN_PHYSICS),  # nothing held out: the fitted windows say it
    ],
)
def test_a_stand_in_is_no_part_of_the_truth(left: float, held_out: float, windows: int, said: Verdict) -> None:
    assert verdict(candidate(1, left * 1e5, held_out, windows=windows)) is said


def test_a_tone_with_own_phases_is_named_where_nothing_stays_and_no_part_of_the_truth_else() -> None:
    assert verdict(candidate(1, 30.0, 1.0, white=True, own_phase=True)) is Verdict.EXPLAINED
    assert verdict(candidate(1, 200.0, 1.04, own_phase=True)) is Verdict.UNKNOWN_PHYSICS


def test_what_is_pressed_as_far_as_is_possible_stands_in_for_something_else() -> None:
    assert verdict(candidate(1, 500.0, 1.5, at_an_edge=True)) is Verdict.UNKNOWN_PHYSICS
    assert verdict(candidate(1, 500.0, 1.05, at_an_edge=True)) is Verdict.UNKNOWN_PHYSICS
    assert verdict(candidate(1, 30.0, 1.0, white=True, at_an_edge=True)) is Verdict.EXPLAINED


def test_a_law_that_nothing_of_the_catalogue_has_is_unknown_however_well_it_fits() -> None:
    assert verdict(candidate(1, 30.0, 1.0, white=True, id="unknown")) is Verdict.UNKNOWN_PHYSICS


@pytest.mark.parametrize(
    ("evidence", "held_out", "said"),
    [
        (-1.9, 900, "log-evidence -1.9 (5 would be needed)"),
        (41.0, 900, "log-evidence 41.0 on the fitted windows, but held-out"),
        (41.0, 0, "log-evidence 41.0 on the fitted windows, but does not explain enough of them"),
    ],
)
def test_what_the_fitted_windows_ask_for_and_others_refuse_is_said_to_be_that(
    evidence: float, held_out: int, said: str
) -> None:
    score = SimpleNamespace(label="gravity-tilt", log_evidence=evidence)
    baseline = SimpleNamespace(held_out=SimpleNamespace(dof=held_out))
    found = SimpleNamespace(first=SimpleNamespace(singles=(score,)), baseline=baseline)
    assert said in best_of_all(found)  # type: ignore[arg-type]
    assert best_of_all(SimpleNamespace(first=SimpleNamespace(singles=()))) == ""  # type: ignore[arg-type]
