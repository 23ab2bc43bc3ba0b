"""What is listed as tried: once each, with how far it was fitted and why it lost."""

from collections.abc import Callable
from dataclasses import replace

import pytest

from fidim_lab.mismatch.conclusion.ranking import MOST_LISTED, ranking
from fidim_lab.mismatch.conclusion.why_lost import odds_against
from fidim_lab.mismatch.fitting.baseline import Baseline
from fidim_lab.mismatch.fitting.refit import Completed, refit
from fidim_lab.mismatch.selection.candidates import Candidate
from fidim_lab.mismatch.selection.select import Selection, select


@pytest.fixture(scope="module")
def dragged(baseline_of: Callable[..., Baseline]) -> Baseline:
    return baseline_of("air-drag-linear:c=0.4", seed=5, windows=4, seconds=4.0)


@pytest.fixture(scope="module")
def found(dragged: Baseline) -> Selection:
    return select(dragged, lambda _: None)


def of_the_first_seconds(start: Baseline, *ids: str) -> Completed:
    tried = [next(h for h in start.tried.direct if h.effect.id == id) for id in ids]
    made = refit(start.short_ground, start.short, tried, [h.absent for h in tried], start.context)
    assert made is not None
    return made


@pytest.mark.slow
def test_models_of_whole_windows_then_of_the_first_seconds_then_scores(dragged: Baseline, found: Selection) -> None:
    friction = of_the_first_seconds(dragged, "swivel-friction")
    passing = (
        friction,
        of_the_first_seconds(dragged, "air-drag-linear"),  # fitted to whole windows later
        replace(friction, at_bound=(True,) * len(friction.at_bound)),  # in another form
        of_the_first_seconds(dragged, "swivel-friction", "gravity-tilt"),
    )
    told = ranking(replace(found, passing=passing), found.best, dragged.context)
    whole, brief = len(found.tried), told[len(found.tried) : len(found.tried) + 2]
    assert [one.effects for one in told[:whole]] == [tuple(h.effect.id for h in one.model.tried) for one in found.tried]
    assert {one.effects for one in brief} == {("swivel-friction",), ("swivel-friction", "gravity-tilt")}
    assert all("of the first 3 s; not fitted to whole windows." in one.why for one in brief)
    assert all(one.held_out_chi2_per_dof is None for one in brief)
    assert len(told) <= whole + 2 + MOST_LISTED
    assert len({one.effects for one in told}) == len(told)


def test_what_is_held_at_a_bound_is_no_possible_cause(dragged: Baseline, found: Selection) -> None:
    friction = of_the_first_seconds(dragged, "swivel-friction")
    held = replace(friction, at_bound=(True,) * len(friction.at_bound))
    told = ranking(replace(found, passing=(held,)), found.best, dragged.context)
    one = next(one for one in told if one.effects == ("swivel-friction",) and "first 3 s" in one.why)
    assert one.why.endswith("A parameter is at the limit of its possible range.")
    assert one.lost == "Its best fit is at the limit of what is possible, or beyond it."
    assert not one.plausible


@pytest.mark.parametrize(("white", "said"), [(True, "accepted: χ²/dof"), (False, "χ²/dof")])
def test_no_effect_is_accepted_only_where_nothing_is_left(
    quiet: Baseline, searched: Selection, claim: Callable[..., Candidate], white: bool, said: str
) -> None:
    best = claim(white=white)
    told = ranking(replace(searched, tried=(best,)), best, quiet.context)
    assert told[0].why.startswith(said)


@pytest.mark.parametrize(
    ("nats", "further", "said"),
    [
        (50.0, False, "The odds are over 1000 to 1 for drag."),
        (4.0, True, "The odds are 55 to 1 for drag."),
        (1.0, True, "It explains no more than drag, with more effects."),
        (-1.0, False, "Not excluded: the odds for drag are under 20 to 1."),
    ],
)
def test_odds_are_told_as_numbers(nats: float, further: bool, said: str) -> None:
    assert odds_against(nats, "drag", further=further) == said


def test_every_rival_of_a_real_search_is_told_why_it_lost(dragged: Baseline, found: Selection) -> None:
    named, *rivals = ranking(found, found.best, dragged.context)
    assert named.effects == ("air-drag-linear",)
    assert not named.lost
    told = {one.name: one.lost for one in rivals}
    assert all(told.values())
    assert told["nothing left out"].startswith("It leaves motion unexplained; air-drag-linear leaves only noise")
    assert "of what air-drag-linear explains, odds over 1000 to 1 against it" in told["swivel-friction"]
    assert told["swivel-friction"].endswith("; nothing in addition to it.")
