"""Work in threads: in order, with what goes wrong."""

from threading import current_thread

import numpy as np
import pytest

from fidim_lab.model import side_by_side as module
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


@pytest.mark.parametrize(("available", "outer", "inner"), [(1, 1, 1), (2, 2, 1), (4, 2, 2), (8, 2, 2)])
def test_pieces_within_pieces_share_the_cores_that_the_outer_ones_leave(monkeypatch, available, outer, inner):
    """So that two fits side by side do not start two threads each on two cores."""
    monkeypatch.setattr(module, "cores", lambda: available)
    rooms: list[int] = []

    class Pool(module.ThreadPoolExecutor):
        def __init__(self, threads: int) -> None:
            rooms.append(threads)
            super().__init__(threads)

    monkeypatch.setattr(module, "ThreadPoolExecutor", Pool)

    def piece() -> list[str]:
        return side_by_side([lambda: current_thread().name] * 3)

    found = side_by_side([piece, piece])
    wanted = ([outer] if outer > 1 else []) + ([inner] * 2 if inner > 1 else [])
    assert rooms == wanted
    if outer > 1 and inner == 1:
        assert all(len(set(names)) == 1 for names in found), "in the thread of the piece itself"
