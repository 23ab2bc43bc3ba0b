"""Windows of one body agree; one of another body is found, however well it is followed."""

import numpy as np
import pytest

from fidim_lab.identification.mle.spread import agreement

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
