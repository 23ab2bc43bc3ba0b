"""Which names are told as the only ones."""

from dataclasses import replace

import pytest

from fidim_lab.mismatch.conclusion.certainty import only_certain
from fidim_lab.mismatch.conclusion.explanation import Explanation, NamedCause, Verdict
from fidim_lab.mismatch.conclusion.parts import Before, EffectParameter


def sure(id: str) -> NamedCause:
    return NamedCause(id, None, (), {"c": EffectParameter(0.01, 1e-4, "N m")}, "says", single=True)


@pytest.mark.parametrize(
    ("verdict", "ids", "single"),
    [
        (Verdict.EXPLAINED, ("swivel-friction",), (True,)),
        (Verdict.EXPLAINED, ("swivel-friction", "umbilical"), (True, True)),
        (Verdict.EXPLAINED, ("hand-contact", "swivel-friction", "umbilical"), (True, True, True)),
        # something stays unexplained: the name may be a part of it
        (Verdict.PARTLY_EXPLAINED, ("swivel-friction",), (False,)),
        # two laws of one family may be a third one
        (Verdict.EXPLAINED, ("rotational-drag", "air-drag-quadratic"), (False, False)),
        (Verdict.EXPLAINED, ("anchor-offset", "umbilical"), (True, True)),
        # a tilt of gravity would do exactly the same
        (Verdict.EXPLAINED, ("constant-force",), (False,)),
        (Verdict.EXPLAINED, ("gravity-tilt",), (True,)),
        # three laws follow much that is none of them
        (Verdict.EXPLAINED, ("swivel-friction", "periodic-force", "anchor-offset"), (False,) * 3),
    ],
)
def test_a_name_is_the_only_one_where_nothing_unlisted_may_be_behind_it(
    verdict: Verdict, ids: tuple[str, ...], single: tuple[bool, ...]
) -> None:
    effects = tuple(sure(id) for id in ids)
    told = Explanation("c", verdict, effects, (), Before(9.0, 1.0), Before(1.0, 0.1), (), {}, {}, None, "m", 1.0)
    assert tuple(one.single for one in only_certain(told).effects) == single


@pytest.mark.parametrize("rivalled", [0, 1])
def test_one_that_has_a_rival_makes_all_uncertain(rivalled: int) -> None:
    effects = [sure("frame-compliance"), sure("anchor-offset")]
    effects[rivalled] = replace(effects[rivalled], single=False)
    told = Explanation(
        "c", Verdict.EXPLAINED, tuple(effects), (), Before(9.0, 1.0), Before(1.0, 0.1), (), {}, {}, None, "m", 1.0
    )
    assert not any(one.single for one in only_certain(told).effects)
