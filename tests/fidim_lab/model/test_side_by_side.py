"""Work in threads: in order, with what goes wrong."""

from threading import Barrier, Event, current_thread

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


@pytest.fixture
def two_cores(monkeypatch):
    """Whatever machine this runs on; both are idle again in the end."""
    idle = module._Idle(1)
    monkeypatch.setattr(module, "_IDLE", idle)
    yield idle
    assert idle.count == 1


def threads_of_pieces() -> set[str]:
    """Names of the threads that do three pieces, each of which waits a while for another thread to come."""

    def piece() -> str:
        Event().wait(0.02)
        return current_thread().name

    return set(side_by_side([piece] * 3))


def test_pieces_within_pieces_stay_in_their_thread_while_every_core_is_at_work(two_cores):
    """So that two fits side by side do not start two threads each on two cores."""
    both = Barrier(2)

    def piece() -> set[str]:
        both.wait(timeout=10)
        names = threads_of_pieces()
        both.wait(timeout=10)
        return names

    first, second = side_by_side([piece, piece])
    assert len(first) == len(second) == 1
    assert first != second


def test_the_last_piece_gets_the_cores_of_those_that_have_ended(two_cores):
    ended = Event()

    def last() -> set[str]:
        ended.wait(timeout=10)
        while two_cores.count == 0:  # until the other thread has found nothing more to do
            Event().wait(0.001)
        return threads_of_pieces()

    assert [len(names) for names in side_by_side([last, lambda: ended.set() or {"ended"}])] == [2, 1]
    assert [len(names) for names in side_by_side([lambda: ended.set() or {"ended"}, last])] == [1, 2]


def test_a_failure_leaves_what_nobody_has_begun_and_gives_all_cores_back(two_cores):
    begun: list[int] = []

    def task(k: int) -> int:
        begun.append(k)
        if k in (1, 2):
            raise ValueError(f"piece {k}")
        Event().wait(0.01)
        return k

    with pytest.raises(ValueError, match="piece 1"):
        side_by_side([lambda k=k: task(k) for k in range(50)])
    assert len(begun) < 10
