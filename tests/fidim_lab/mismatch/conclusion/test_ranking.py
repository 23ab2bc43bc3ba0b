"""What is listed as tried: once each, with how far it was fitted and why it lost."""

from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from fidim_lab.mismatch.conclusion import ranking as ranked
from fidim_lab.mismatch.conclusion import why_lost as lost
from fidim_lab.mismatch.conclusion.ranking import ranking
from fidim_lab.mismatch.conclusion.thresholds import CONCLUSION
from fidim_lab.mismatch.conclusion.why_lost import odds_against
from fidim_lab.mismatch.fitting.baseline import Baseline
from fidim_lab.mismatch.selection.select import select


@dataclass(frozen=True)
class Effect:
    """One that is always possible."""

    id: str
    cable: int | None = None

    @property
    def label(self) -> str:
        """As it is listed."""
        return self.id

    def plausible(self, theta: object, context: object) -> None:
        """No reason against it."""


def hypothesis(id: str) -> SimpleNamespace:
    return SimpleNamespace(effect=Effect(id), label=id, theta=lambda value: value)


def model(*ids: str, chi2: float, at_bound: bool = False) -> SimpleNamespace:
    return SimpleNamespace(
        tried=tuple(hypothesis(id) for id in ids),
        fit=SimpleNamespace(chi2_per_dof=chi2, journey=SimpleNamespace(ends=np.array([3.0, 2.0]))),
        theta_of=lambda k: (np.zeros(1), np.zeros(1)),
        at_bound=(at_bound,),
        is_white=chi2 < 1.05,
        chi2=chi2,
    )


def whole(*ids: str, chi2: float, held_out: float, white: bool) -> SimpleNamespace:
    held = SimpleNamespace(chi2_per_dof=held_out, dof=1000, rms=1e-4 * held_out)
    says = SimpleNamespace(says="White." if white else "Not white.")
    return SimpleNamespace(model=model(*ids, chi2=chi2), held_out=held, whiteness=says, is_white=white)


def score(id: str) -> SimpleNamespace:
    return SimpleNamespace(tried=(hypothesis(id),), theta=(np.zeros(1),), gain=100.0, log_evidence=40.0)


@pytest.fixture
def _by_chi2(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (ranked, lost):
        monkeypatch.setattr(module, "evidence", lambda one, than, scale: than.fit.chi2_per_dof - one.fit.chi2_per_dof)


@pytest.mark.usefixtures("_by_chi2")
def test_models_of_whole_windows_then_of_the_first_seconds_then_scores() -> None:
    baseline = whole(chi2=9.0, held_out=9.5, white=False)
    drag = whole("drag", chi2=1.0, held_out=1.01, white=True)
    found = SimpleNamespace(
        tried=(drag, baseline),
        passing=(
            model("friction", chi2=1.5),
            model("drag", chi2=1.0),  # fitted to whole windows later
            model("friction", chi2=1.2, at_bound=True),  # in a wider form
            model("friction", "hose", chi2=1.1),
        ),
        first=SimpleNamespace(
            singles=[score("drag"), score("friction"), *(score(f"e{k}") for k in range(20))],
            projected=SimpleNamespace(tried=()),
            rest=400.0,
        ),
        last=SimpleNamespace(model=drag.model, singles=[]),
    )
    told = ranking(found, drag, None)  # type: ignore[arg-type]
    assert [one.effects for one in told[:5]] == [("drag",), (), ("friction", "hose"), ("friction",), ("e0",)]
    assert len(told) == 4 + CONCLUSION.ranking_listed
    assert told[0].why == "accepted: χ²/dof 1.000 fitted, 1.010 held out. White."
    assert told[1].why == "χ²/dof 9.000 fitted, 9.500 held out. Not white."
    assert told[2].why == "χ²/dof 1.100 of the first 3 s; not fitted to whole windows."
    assert told[3].why.endswith("A parameter is held at the bound of what is possible.")
    assert [one.lost for one in told[:5]] == [
        "",
        "It leaves motion unexplained, drag leaves only noise (held out: 0.95 mm against 0.1 mm).",
        "It leaves motion unexplained in the first seconds, drag leaves only noise.",
        "It fits best at the bound of what is possible, or beyond it.",
        "Alone it explains 25 % of what is missing, drag all but noise.",
    ]
    assert [one.plausible for one in told[:4]] == [True, True, True, False]
    assert [one.held_out_chi2_per_dof for one in told[1:3]] == [9.5, None]


@pytest.mark.usefixtures("_by_chi2")
@pytest.mark.parametrize(("white", "said"), [(True, "accepted: χ²/dof"), (False, "χ²/dof")])
def test_no_effect_is_accepted_only_where_nothing_is_left(white: bool, said: str) -> None:
    baseline = whole(chi2=1.0, held_out=1.0, white=white)
    found = SimpleNamespace(tried=(baseline,), passing=(), first=SimpleNamespace(singles=[]))
    (told,) = ranking(found, baseline, None)  # type: ignore[arg-type]
    assert told.why.startswith(said)


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


def test_every_rival_of_a_real_search_is_told_why_it_lost(baseline_of: Callable[..., Baseline]) -> None:
    baseline = baseline_of("air-drag-linear:c=0.4", seed=5, windows=4, seconds=4.0)
    found = select(baseline, lambda _: None)
    named, *rivals = ranking(found, found.best, baseline.context)
    assert named.effects == ("air-drag-linear",)
    assert not named.lost
    told = {one.name: one.lost for one in rivals}
    assert all(told.values())
    assert told["nothing left out"].startswith("It leaves motion unexplained, air-drag-linear leaves only noise")
    assert "Alone it explains" in told["swivel-friction"]
    assert "of what air-drag-linear does (odds of over 1000 to 1)" in told["swivel-friction"]
    assert told["swivel-friction"].endswith("beside that it adds nothing.")
