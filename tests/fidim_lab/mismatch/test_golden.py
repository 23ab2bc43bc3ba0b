"""Answers to small seeded campaigns are those that are kept (`python -m benchmarks.golden --write` keeps new ones)."""

import json

import pytest

from benchmarks.golden import CASES, FAST, answers, differences, kept_file

TOLERANCE = 1e-4
"""of numbers, on whatever machine; on one and the same they agree to the bit"""


@pytest.mark.parametrize(
    "name", [name if name in FAST else pytest.param(name, marks=pytest.mark.slow) for name in CASES]
)
def test_answers_are_those_that_are_kept(name: str) -> None:
    kept = json.loads(kept_file(name).read_text(encoding="utf-8"))
    assert not list(differences(kept, answers(CASES[name]), TOLERANCE))


def test_differences_are_found_wherever_they_are() -> None:
    kept = {"a": [1.0, "left: 3.21 N"], "b": None}
    assert not list(differences(kept, {"a": [1.0 + 1e-6, "left: 3.22 N"], "b": None}, TOLERANCE))
    assert list(differences(kept, {"a": [1.1, "left: 3.21 N"], "b": None}, TOLERANCE))
    assert list(differences(kept, {"a": [1.0, "left: 3.21 m"], "b": None}, TOLERANCE))
    assert list(differences(kept, {"a": [1.0, "left: 3.21 N"]}, TOLERANCE))
    assert list(differences(kept, {"a": [1.0 + 1e-6, "left: 3.21 N"], "b": None}))
