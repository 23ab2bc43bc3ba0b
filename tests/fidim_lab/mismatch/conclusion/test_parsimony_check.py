"""Effects of much freedom against a wrench without a name, on campaigns of another simulator and case by case."""

from types import SimpleNamespace

import pytest

from fidim_lab.mismatch.conclusion.explanation import Verdict
from fidim_lab.mismatch.conclusion.parsimony_check import unless_outdone
from fidim_lab.mismatch.conclusion.verdict import Judged
from fidim_lab.mismatch.fitting.baseline import Baseline
from fidim_lab.mismatch.fitting.holdout import predict
from fidim_lab.mismatch.fitting.refit import refit
from fidim_lab.mismatch.selection import single_force
from fidim_lab.mismatch.selection.candidates import Candidate, candidate
from fidim_lab.mismatch.unknown_force.family import Dependence


def judged(start: Baseline, *ids: str) -> tuple[Judged, SimpleNamespace]:
    """As if these effects had been named; and what a search would hand over."""
    tried = [next(h for h in start.tried.direct if h.effect.id == id) for id in ids]
    model = refit(start.whole_ground, start.as_it_is.fit, tried, [h.absent for h in tried], start.context)
    assert model is not None
    named = candidate(model, predict(model, start.held_out))
    return Judged(Verdict.EXPLAINED, named), SimpleNamespace(
        baseline=candidate(start.as_it_is, start.predicted), alone=None
    )


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
@pytest.mark.sampled(1)
def test_what_a_simple_wrench_says_better_is_not_named(
    baseline_of, hidden: str, named: tuple[str, str], wrench: Dependence | None
) -> None:
    start = baseline_of(hidden, seed=3, windows=6, seconds=3.0)
    said: list[str] = []
    claim, found = judged(start, *named)
    after = unless_outdone(claim, found, start.campaign, said.append)
    assert said == [f"modelling what {claim.named.model.label} may stand for, without a name"]
    if wrench is None:
        assert after is claim
    else:
        assert after.verdict is Verdict.UNKNOWN_PHYSICS
        assert after.named is found.baseline
        assert after.outdone_by is not None
        assert after.outdone_by.terms[0].dependence is wrench


CHI2, DOF = 20_000.0, 20_000


def fit(values: int, chi2: float = CHI2) -> SimpleNamespace:
    likelihood = SimpleNamespace(own=12, recordings=(None,) * 6)
    return SimpleNamespace(
        values=(0.0,) * values, likelihood=likelihood, remainders=(SimpleNamespace(chi2=chi2, dof=DOF),)
    )


def effects(count: int, held: int = 10_000, springs: bool = False, *, several: int = 1, dof: int = DOF) -> Candidate:
    first = SimpleNamespace(effect=SimpleNamespace(parameters=(None,) * count))
    others = (SimpleNamespace(effect=SimpleNamespace(parameters=())),) * (several - 1)
    model = SimpleNamespace(
        tried=(first, *others),
        whole=True,
        fit=fit(9 + count),
        chi2=CHI2,
        dof=dof,
        mechanism=SimpleNamespace(springs=springs),
    )
    model.label = "something"
    left = SimpleNamespace(chi2=10_000.0, dof=held)
    return SimpleNamespace(model=model, held_out=left, whiteness=SimpleNamespace(level=1.0))  # type: ignore[return-value]


def rival_of(values: int, gained: float, foretold: float) -> SimpleNamespace:
    after = SimpleNamespace(chi2=10_000.0 - foretold, dof=10_000)
    return SimpleNamespace(terms=("one",), fit=fit(9 + values, CHI2 - gained), after=after)


def doubted(monkeypatch: pytest.MonkeyPatch, claim: Candidate, wrench: SimpleNamespace) -> tuple[Verdict, list[bool]]:
    """The verdict on what is claimed beside that wrench; and of each time it was modelled, whether it alone."""
    asked: list[bool] = []

    def modelled(*_: object, alone: bool) -> SimpleNamespace:
        asked.append(alone)
        return wrench

    monkeypatch.setattr(single_force, "modelled", modelled)
    found = SimpleNamespace(baseline=SimpleNamespace(model=None), alone=None)
    campaign = SimpleNamespace(of_role=lambda role: ("a window",))
    after = unless_outdone(Judged(Verdict.EXPLAINED, claim), found, campaign, lambda _: None)  # type: ignore[arg-type]
    return after.verdict, asked


@pytest.mark.parametrize(
    ("parameters", "rival", "gained", "foretold", "outdone_by_it"),
    [
        (9, 9, 40.0, 40.0, True),
        (9, 9, 40.0, 4.0, False),  # held-out windows do not agree
        (9, 9, 4.0, 40.0, False),
        (9, 14, 40.0, 40.0, False),  # more freedom, which may gain as much by chance
        (14, 9, -30.0, 40.0, True),  # less
    ],
)
def test_freedom_is_paid_for_and_held_out_windows_must_agree(
    monkeypatch: pytest.MonkeyPatch, parameters: int, rival: int, gained: float, foretold: float, outdone_by_it: bool
) -> None:
    verdict, _ = doubted(monkeypatch, effects(parameters), rival_of(rival, gained, foretold))
    assert (verdict is Verdict.UNKNOWN_PHYSICS) is outdone_by_it


def test_all_is_tried_against_much_freedom_one_wrench_against_several_effects_and_nothing_else_doubted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    wrench = rival_of(8, 40.0, 40.0)
    assert doubted(monkeypatch, effects(9), wrench) == (Verdict.UNKNOWN_PHYSICS, [False])
    assert doubted(monkeypatch, effects(9, several=2), wrench) == (Verdict.UNKNOWN_PHYSICS, [False])
    assert doubted(monkeypatch, effects(8, several=2), wrench) == (Verdict.UNKNOWN_PHYSICS, [True])
    assert doubted(monkeypatch, effects(8), wrench) == (Verdict.EXPLAINED, [])


def test_what_named_effects_lose_is_charged_like_the_rest(monkeypatch: pytest.MonkeyPatch) -> None:
    half = effects(9, dof=DOF // 2)  # with the χ² of all windows in half of them
    assert doubted(monkeypatch, half, rival_of(9, 0.0, 40.0))[0] is Verdict.UNKNOWN_PHYSICS
    assert doubted(monkeypatch, effects(9), rival_of(9, 0.0, 40.0))[0] is Verdict.EXPLAINED


@pytest.mark.parametrize(
    ("claim", "windows"),
    [
        (Judged(Verdict.UNKNOWN_PHYSICS, effects(12)), ("v01",)),
        (Judged(Verdict.EXPLAINED, effects(12, springs=True)), ("v01",)),
        (Judged(Verdict.EXPLAINED, effects(12)), ()),
        (Judged(Verdict.EXPLAINED, effects(8)), ("v01",)),
    ],
    ids=["nothing is named", "cables stretch", "nothing is held out", "one effect of few parameters"],
)
def test_nothing_is_modelled_where_there_is_nothing_to_doubt_or_to_judge_by(
    monkeypatch: pytest.MonkeyPatch, claim: Judged, windows: tuple[str, ...]
) -> None:
    monkeypatch.setattr(single_force, "modelled", lambda *_, **__: pytest.fail("modelled"))
    campaign = SimpleNamespace(of_role=lambda role: windows)
    found = SimpleNamespace(baseline=SimpleNamespace(model=None), alone=None)
    assert unless_outdone(claim, found, campaign, lambda _: None) is claim  # type: ignore[arg-type]
