"""What is listed as tried: once each, with how far it was fitted."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from fidim_lab.mismatch.conclusion import ranking as ranked
from fidim_lab.mismatch.conclusion.ranking import ranking
from fidim_lab.mismatch.conclusion.thresholds import CONCLUSION


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
    )


def whole(*ids: str, chi2: float, held_out: float, white: bool) -> SimpleNamespace:
    held = SimpleNamespace(chi2_per_dof=held_out, dof=1000)
    says = SimpleNamespace(says="White." if white else "Not white.")
    return SimpleNamespace(model=model(*ids, chi2=chi2), held_out=held, whiteness=says, is_white=white)


def score(id: str) -> SimpleNamespace:
    return SimpleNamespace(tried=(hypothesis(id),), theta=(np.zeros(1),), gain=100.0, log_evidence=40.0)


@pytest.fixture
def _by_chi2(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ranked, "evidence", lambda one, than, scale: than.fit.chi2_per_dof - one.fit.chi2_per_dof)


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
        first=SimpleNamespace(singles=[score("drag"), score("friction"), *(score(f"e{k}") for k in range(20))]),
    )
    told = ranking(found, drag, None)  # type: ignore[arg-type]
    assert [one.effects for one in told[:5]] == [("drag",), (), ("friction", "hose"), ("friction",), ("e0",)]
    assert len(told) == 4 + CONCLUSION.ranking_listed
    assert told[0].why == "accepted: χ²/dof 1.000 fitted, 1.010 held out. White."
    assert told[1].why == "χ²/dof 9.000 fitted, 9.500 held out. Not white."
    assert told[2].why == "χ²/dof 1.100 of the first 3 s; not fitted to whole windows."
    assert told[3].why.endswith("A parameter is held at the bound of what is possible.")
    assert [one.plausible for one in told[:4]] == [True, True, True, False]
    assert [one.held_out_chi2_per_dof for one in told[1:3]] == [9.5, None]


@pytest.mark.usefixtures("_by_chi2")
@pytest.mark.parametrize(("white", "said"), [(True, "accepted: χ²/dof"), (False, "χ²/dof")])
def test_no_effect_is_accepted_only_where_nothing_is_left(white: bool, said: str) -> None:
    baseline = whole(chi2=1.0, held_out=1.0, white=white)
    found = SimpleNamespace(tried=(baseline,), passing=(), first=SimpleNamespace(singles=[]))
    (told,) = ranking(found, baseline, None)  # type: ignore[arg-type]
    assert told.why.startswith(said)
