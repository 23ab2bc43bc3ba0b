"""What has no name is told in words only where it takes most of what is left."""

from collections.abc import Callable

import numpy as np
import pytest

from fidim_lab.data.records import Robot
from fidim_lab.mismatch.conclusion.explanation import Explanation, Verdict
from fidim_lab.mismatch.conclusion.parts import Before
from fidim_lab.mismatch.conclusion.unnamed import with_unknown
from fidim_lab.mismatch.conclusion.verdict import Judged
from fidim_lab.mismatch.fitting.baseline import Baseline
from fidim_lab.mismatch.fitting.holdout import HeldOut
from fidim_lab.mismatch.linearised.hypotheses import general, hypotheses
from fidim_lab.mismatch.selection.candidates import Candidate
from fidim_lab.mismatch.unknown_force.family import Dependence
from fidim_lab.mismatch.unknown_force.unknown import Term, UnknownForce

WORDS = ("It repeats every 0.2 s: 0.65 N.",)


def held(chi2_per_dof: float) -> HeldOut:
    return HeldOut(1000 * chi2_per_dof, 1000, 1e-3, {})


@pytest.mark.parametrize(("after", "told"), [(5.4, True), (5.6, False)])
def test_a_wrench_that_takes_less_than_half_is_not_described(
    quiet: Baseline, claim: Callable[..., Candidate], after: float, told: bool
) -> None:
    term = Term("repeats", Dependence.PERIODIC, None, None, (5.0,), WORDS, True)
    wrench = UnknownForce((term,), 0.9, held(10.0), held(after), WORDS, None, (), (), quiet.fit, 1.0)
    base = Explanation(
        "c", Verdict.UNKNOWN_PHYSICS, (), (), Before(10.0, 10.0), Before(1.0, 1.0), (), {}, {}, None, "Missing.", 1.0
    )
    judged = Judged(Verdict.UNKNOWN_PHYSICS, claim(), wrench)
    found, model = with_unknown(base, judged, quiet.campaign, lambda _: None)
    assert model.fit is quiet.fit
    assert found.unknown is not None
    assert (WORDS[0] in found.message, found.unknown.words == WORDS) == (told, told)
    assert found.chi2_per_dof.after == pytest.approx(after)
    assert ("less than half" in found.message) is not told


@pytest.mark.parametrize(
    ("left", "by_law", "wrench"), [(1.0, True, False), (4.8, True, False), (5.6, True, True), (6.2, False, True)]
)
def test_figures_are_those_of_a_law_where_it_predicts_as_well_as_a_wrench(
    irma4: Robot, quiet: Baseline, claim: Callable[..., Candidate], left: float, by_law: bool, wrench: bool
) -> None:
    simple = next(h for h in hypotheses(irma4).direct if h.effect.id == "air-drag-linear")
    ((flat, theta),) = simple.effect.wider(np.array([0.1]), irma4)
    term = Term("repeats", Dependence.PERIODIC, None, None, (5.0,), WORDS, True)
    generic = UnknownForce((term,), 0.9, held(10.0), held(5.4), WORDS, None, (), (), quiet.fit, 1.0)
    base = Explanation(
        "c", Verdict.UNKNOWN_PHYSICS, (), (), Before(10.0, 10.0), Before(1.0, 1.0), (), {}, {}, None, "Missing.", 1.0
    )
    law = claim(general(simple, flat, theta), held_out=left, white=left == 1.0, theta=theta)
    judged = Judged(Verdict.UNKNOWN_PHYSICS, claim(), generic, law=law)
    found, model = with_unknown(base, judged, quiet.campaign, lambda _: None)
    assert (found.unknown is not None) is wrench
    assert found.chi2_per_dof.after == pytest.approx(left if by_law else 5.4)
    assert (model is law.model) is by_law
    assert [(term.like, term.parameters["c"].value) for term in found.law] == (
        [("a drag flatter than air's", 0.1)] if by_law else []
    )
