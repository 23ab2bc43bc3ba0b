"""Which terms of two models of the first seconds are fitted together."""

from collections.abc import Callable

import pytest

from fidim_lab.data.records import Robot
from fidim_lab.mismatch.linearised.hypotheses import Hypothesis, hypotheses
from fidim_lab.mismatch.selection.candidates import Candidate
from fidim_lab.mismatch.selection.unions import unions


@pytest.mark.parametrize(
    ("raced", "expected"),
    [
        # terms, and χ²/dof that they leave
        ((("ab", 1.09), ("ac", 1.15), ("a", 1.8)), ["abc"]),
        ((("ac", 1.15), ("a", 1.8), ("ab", 1.09)), ["abc"]),  # the best first, whenever they were found
        ((("ab", 1.09), ("ac", 1.5)), []),  # that leaves much more
        ((("ab", 1.09), ("ac", 1.1), ("abc", 1.02)), []),  # known already
        ((("ab", 1.09), ("cd", 1.1)), []),  # too many
        ((("a", 1.09), ("b", 1.1), ("c", 1.11)), ["ab", "ac"]),
        ((("a", 1.09), ("p", 1.1)), []),  # a tone has no beginning at nothing
        ((("a", 1.09), ("e", 1.1)), []),  # nor has a spring
        ((("c", 1.09), ("w", 1.1)), []),  # two forms of one effect: the data tell their sum
        ((), []),
    ],
)
def test_terms_of_two_models_that_did_well_are_joined(
    irma4: Robot, claim: Callable[..., Candidate], raced: tuple[tuple[str, float], ...], expected: list[str]
) -> None:
    every = hypotheses(irma4)
    ids = {
        "a": "air-drag-linear",
        "b": "swivel-friction",
        "c": "rotational-drag",
        "d": "gravity-tilt",
        "e": "cable-elasticity",
    }
    known: dict[str, Hypothesis] = {
        letter: next(h for h in every.direct if h.effect.id == id) for letter, id in ids.items()
    }
    known["p"] = every.periodic[0]
    known["w"] = next(h for h in every.direct if h.effect.id == ids["c"] and h.effect != known["c"].effect)
    models = [claim(*(known[k] for k in terms), fitted=left).model for terms, left in raced]
    letters = {id(h): letter for letter, h in known.items()}
    found = unions(models, 3)
    assert ["".join(sorted(letters[id(h)] for h in terms)) for terms in found] == expected
