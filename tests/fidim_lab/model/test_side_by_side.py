"""Work in threads: in order, with what goes wrong."""

import numpy as np
import pytest

from fidim_lab.model.side_by_side import cores, side_by_side


def test_results_come_in_the_order_of_the_tasks():
    assert side_by_side([lambda k=k: k * k for k in range(7)]) == [k * k for k in range(7)]


def test_an_error_in_a_task_is_that_of_the_whole():
    def fail() -> int:
        raise ValueError("here")

    with pytest.raises(ValueError, match="here"):
        side_by_side([lambda: 1, lambda: 2, fail, lambda: 3])


def test_what_numpy_is_to_ignore_it_ignores_in_every_task():
    with np.errstate(invalid="ignore"):
        found = side_by_side([lambda: np.array([np.inf]) - np.array([np.inf])] * 3)
    assert np.isnan(found).all()
    with np.errstate(invalid="raise"), pytest.raises(FloatingPointError):
        side_by_side([lambda: np.array([np.inf]) - np.array([np.inf])] * 3)


def test_there_is_a_core():
    assert cores() >= 1
