"""Thresholds halved and doubled: what is changed, and how changes of answers are counted."""

import pytest

from benchmarks.sensitivity import STAGES, UNCHANGED, changed, changes, page


@pytest.mark.parametrize(
    ("value", "factor", "expected"),
    [
        (5.0, 0.5, 2.5),
        (3, 2.0, 6),
        (1, 0.5, 1),
        (0.95, 2.0, 0.9),
        (0.5, 2.0, 1.0),
        ((2, 4.0), 0.5, (1, 2.0)),
    ],
    ids=["number", "count", "at least one", "chance near one", "share", "several"],
)
def test_what_a_factor_makes_of_a_threshold(value: object, factor: float, expected: object) -> None:
    assert changed(value, factor) == pytest.approx(expected)


def test_each_threshold_is_halved_and_doubled_and_what_differs_is_counted() -> None:
    every = list(changes(tuple(STAGES)))
    assert len({one.key for one in every}) == len(every) > 200
    halved = next(one for one in every if (one.stage, one.name) == ("Shared", "enough"))
    usual = {case: {"answer": "nothing-missing", "cpu": 1.0} for case in ("null", "two")}
    text = page({UNCHANGED.key: usual, halved.key: {"null": {"answer": "explained + clock-rate", "cpu": 1.0}}})
    assert "1 of 2 answers differ, 50.0 %" in text
    assert "| Shared.enough | 5.0 | 2.5 | 1 | 1/2 |" in text
    assert "- Shared.enough × 0.5, null: nothing-missing → explained + clock-rate" in text
