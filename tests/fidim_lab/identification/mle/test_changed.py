"""A payload that was put on for some windows is seen in these; what is missing in all is not called a change."""

import numpy as np
import pytest

from fidim_lab.data.records import Body, Campaign, Robot, Window
from fidim_lab.effects.dissipation.drag import RotationalDrag
from fidim_lab.identification.mle.identify import identify
from fidim_lab.identification.mle.odd_windows.changed import changed
from fidim_lab.model.mechanism import Mechanism

from .conftest import Record, true_body


@pytest.fixture(scope="module")
def heavier(four: Robot) -> Body:
    own = true_body(four)
    return Body(own.com + np.array([0.004, -0.003, 0.002]), own.inertia * np.array([1.06, 1.04, 1.08, 1.0, 1.0, 1.0]))


@pytest.fixture(scope="module")
def windows(four: Robot, record: Record, heavier: Body) -> tuple[Window, ...]:
    plain, loaded = (record(four, 6, seconds=2.0, markers=3, body=body) for body in (None, heavier))
    return (*plain[:3], *loaded[3:5], *plain[5:])


SAYS = "One body explains windows w1, w2, w3, w6, and contradicts all of w4, w5:"


def test_windows_with_a_payload_are_told_from_those_without(four: Robot, windows: tuple[Window, ...]) -> None:
    assert changed(Mechanism(four, native=True), windows).startswith(SAYS)


@pytest.mark.slow
def test_the_answer_says_so(four: Robot, windows: tuple[Window, ...]) -> None:
    found = identify(Campaign("loaded", four, 100.0, windows), native=True)
    assert not found.outcome.answers
    assert SAYS in found.answer.verdict


def test_a_single_window_and_what_is_missing_in_all_are_no_change(four: Robot, record: Record, heavier: Body) -> None:
    plain, loaded = (record(four, 6, seconds=2.0, markers=3, body=body) for body in (None, heavier))
    assert changed(Mechanism(four, native=True), [*plain[:4], loaded[4], plain[5]]) == ""
    slowed = record(four, 6, seconds=2.0, markers=3, effects=(RotationalDrag(),), theta=(0.02,))
    assert changed(Mechanism(four, native=True), slowed) == ""
