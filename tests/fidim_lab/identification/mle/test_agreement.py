"""Windows of one body agree; one of another body is found, however well it is followed."""

from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.data.records import Robot
from fidim_lab.identification.mle.figures import figures_of
from fidim_lab.identification.mle.fit import fit
from fidim_lab.identification.mle.spread import agreement
from fidim_lab.model.mechanism import Mechanism

from .conftest import Record

WINDOWS, SIZE = 4, 9


def tables(rng: np.random.Generator, other: float) -> np.ndarray:
    """Reduced least squares with unit noise; the first window's parameters are off by `other` of their own sd."""
    made = []
    for w in range(WINDOWS):
        rows = rng.normal(size=(40, SIZE)) * np.geomspace(0.1, 10.0, SIZE)
        apart = rows @ (other / np.sqrt(np.diag(rows.T @ rows))) if w == 0 else 0.0
        made.append(np.linalg.qr(np.column_stack([rows, rng.normal(size=40) - apart]), mode="r"))
    return np.array(made)


@pytest.mark.parametrize("other", [0.0, 6.0])
def test_chance_is_what_it_says_and_another_body_is_seen(other: float) -> None:
    rng = np.random.default_rng(3)
    prior = np.zeros((SIZE, SIZE + 1))
    seen = [agreement(tables(rng, other), prior) for _ in range(200)]
    rare = np.mean(np.array(seen) < 0.05)
    assert rare > 0.95 if other else rare < 0.09  # 5 % expected; 200 draws have an sd of 1.5 %


def test_two_windows_say_nothing() -> None:
    assert agreement(tables(np.random.default_rng(1), 6.0)[:2], np.zeros((SIZE, SIZE + 1))) == 1.0


def test_more_noise_than_the_robot_file_states_is_no_contradiction(four: Robot, record: Record) -> None:
    """Each window's estimate scatters by four times its nominal sd; so does what is left."""
    stated = replace(four, sensors=replace(four.sensors, marker_noise=four.sensors.marker_noise / 4))
    found = fit(Mechanism(stated, native=True), record(four, 4, seconds=4.0))
    assert found.explained
    assert agreement(found.tables, found.prior_rows) < 0.01
    assert figures_of(found, four.nominal).agree
