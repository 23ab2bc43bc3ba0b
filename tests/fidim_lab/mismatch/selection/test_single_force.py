"""One wrench without a name against models of the first seconds, on campaigns of another simulator and case by case."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.identification.mle.fit import Fit
from fidim_lab.mismatch.fitting.baseline import Baseline
from fidim_lab.mismatch.fitting.refit import Completed, refit
from fidim_lab.mismatch.selection.candidates import Candidate, candidate
from fidim_lab.mismatch.selection.select import Selection
from fidim_lab.mismatch.selection.single_force import LoneWrench, nats_beyond

BASE = "modelling one unknown force in place of {}"


def of_first_seconds(start: Baseline, *ids: str) -> Completed:
    """The model with these effects, fitted to the first seconds alone."""
    tried = [next(h for h in start.tried.direct if h.effect.id == id) for id in ids]
    model = refit(start.short_ground, start.short, tried, [h.absent for h in tried], start.context)
    assert model is not None
    return model


@pytest.mark.parametrize(
    ("hidden", "named", "outdone"),
    [
        (("unknown-gradient:k=1.5,x=1.2,y=-0.1,z=-0.3",), ("umbilical", "constant-force"), True),
        (("umbilical:k=3,c=0.1,x=0.2,y=0.5,z=-1.0",), ("umbilical", "constant-force"), False),
        (("air-drag-linear:c=0.5", "swivel-friction:c=0.01"), ("air-drag-linear", "swivel-friction"), False),
    ],
    ids=["a saddle of force", "a hose", "the two that are named"],
)
@pytest.mark.slow
def test_effects_that_act_are_not_outdone(
    baseline_of: Callable[..., Baseline], hidden: tuple[str, ...], named: tuple[str, ...], outdone: bool
) -> None:
    start = baseline_of(*hidden, seed=3, windows=6, seconds=4.0)
    said: list[str] = []
    short = of_first_seconds(start, *named)
    lone = LoneWrench(candidate(start.as_it_is, start.predicted), start.campaign, said.append)
    assert lone.seek([short]).outdoes([short]) is outdone
    assert said == [BASE.format(short.label)]
    assert lone.found is not None
    assert lone.leaves_noise or not outdone


def test_it_is_sought_once_and_only_where_there_may_be_stand_ins(
    quiet: Baseline, searched: Selection, claim: Callable[..., Candidate]
) -> None:
    asked: list[str] = []
    lone = LoneWrench(searched.baseline, quiet.campaign, asked.append)
    drag, tilt = (
        next(h for h in quiet.tried.direct if h.effect.id == id) for id in ("air-drag-linear", "gravity-tilt")
    )
    one, two, three = (claim(*terms).model for terms in ((drag,), (drag, tilt), (drag, tilt, drag)))
    assert one.is_white
    for simple in ([], [one]):
        assert not lone.seek(simple).outdoes(simple)
    assert lone.found is None
    assert not lone.leaves_noise
    for short in ([two], [three]):
        assert not lone.seek(short).outdoes(short)
    assert asked == [BASE.format(two.label)]


SAMPLES = 300


@pytest.fixture
def fit(quiet: Baseline, fit_with: Callable[..., Fit]) -> Callable[..., Fit]:
    """One window of 100 samples a second, all residuals of which have that size in standard deviations."""

    def made(seconds: float, size: float, further: int = 0, lost: int = 0) -> Fit:
        t = 2.0 + np.arange(round(100 * seconds)) / 100.0
        residuals = np.full((len(t), 1, 3), size * quiet.fit.likelihood.noise)
        residuals[:lost] = np.nan
        left = replace(quiet.fit.remainders[0], t=t, residuals=residuals)
        return replace(fit_with(np.zeros(further), 0.0), remainders=(left,))

    return made


@pytest.mark.parametrize(
    ("whole", "short", "nats"),
    [
        ((3.0, 1.0), (1.0, 1.2), 0.5 * SAMPLES * 0.44),
        ((3.0, 1.0), (1.0, 0.8), -0.5 * SAMPLES * 0.36),
        ((3.0, 1.0, 3), (1.0, 1.2), 0.5 * SAMPLES * 0.44 - 1.5 * np.log(SAMPLES)),  # freedom is paid for
        ((3.0, 1.0), (1.0, 1.2, 3), 0.5 * SAMPLES * 0.44),  # and its absence not rewarded
        ((0.9, 1.0), (1.0, 1.2), -np.inf),  # it follows less far
        ((3.0, 1.0, 0, 1), (1.0, 1.2), -np.inf),
    ],
)
def test_what_a_fit_of_whole_windows_says_of_the_first_seconds(
    fit: Callable[..., Fit], whole: tuple[float, ...], short: tuple[float, ...], nats: float
) -> None:
    assert nats_beyond(fit(*whole), fit(*short)) == pytest.approx(nats)
