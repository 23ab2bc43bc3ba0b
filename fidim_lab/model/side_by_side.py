"""Independent pieces of numerical work on all cores of the machine, in threads (OPENBLAS_NUM_THREADS=1 suits that).

CasADi's functions and numpy's linear algebra let go of Python's lock while they compute; what is mostly Python gains
little here. The larger the pieces the better: whole fits rather than the batches of windows within one. Pieces within
pieces get the cores that are idle when they begin: none while as many outer ones are at work, all once one alone is
left. Results are those of one core, to the bit.
"""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextvars import copy_context
from threading import Lock
from typing import Generic, TypeVar

T = TypeVar("T")

MOST = 4
"""threads: beyond, Python's lock is what they wait for"""


def side_by_side(tasks: Sequence[Callable[[], T]]) -> list[T]:
    """What the tasks return, in their order; where some fail, the error of the first of these."""
    helpers = _IDLE.lend(len(tasks) - 1)
    if helpers == 0:
        return [task() for task in tasks]
    pieces = _Pieces(tasks)

    def help_out() -> None:
        try:
            pieces.work()
        finally:
            _IDLE.give_back()

    with ThreadPoolExecutor(helpers) as pool:
        for _ in range(helpers):
            pool.submit(copy_context().run, help_out)  # what numpy is to ignore is said in the caller's context
        pieces.work()
        _IDLE.give_back()  # this thread only waits now
    _IDLE.take()
    return pieces.results()


def found_side_by_side(tasks: Sequence[Callable[[], T | None]]) -> list[T]:
    """What those of them return that find something, in their order."""
    return [found for found in side_by_side(tasks) if found is not None]


def cores() -> int:
    """That this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class _Idle:
    """How many cores no thread of ours computes on."""

    def __init__(self, count: int) -> None:
        self._lock, self.count = Lock(), count

    def lend(self, wanted: int) -> int:
        """As many as are wanted, or as there are."""
        with self._lock:
            lent = max(0, min(wanted, self.count))
            self.count -= lent
            return lent

    def take(self) -> None:
        """One for a thread that goes on, whether there is one or not: it does not wait for others to end."""
        with self._lock:
            self.count -= 1

    def give_back(self) -> None:
        """One that was lent or taken."""
        with self._lock:
            self.count += 1


_IDLE = _Idle(min(MOST, cores()) - 1)


class _Pieces(Generic[T]):
    """Tasks that several threads do, one after the other in their order."""

    def __init__(self, tasks: Sequence[Callable[[], T]]) -> None:
        self._tasks, self._lock, self._next = tasks, Lock(), 0
        self._done: dict[int, T] = {}
        self._failed: dict[int, BaseException] = {}

    def work(self) -> None:
        """Do what nobody has begun, until nothing is left or something has failed."""
        while (k := self._begun()) is not None:
            try:
                self._done[k] = self._tasks[k]()
            except BaseException as error:  # raised by `results`, in the thread that asked
                self._failed[k] = error

    def results(self) -> list[T]:
        """In the order of the tasks. Raises what the first of those raised that failed."""
        if self._failed:
            raise self._failed[min(self._failed)]
        return [self._done[k] for k in range(len(self._tasks))]

    def _begun(self) -> int | None:
        with self._lock:
            if self._failed or self._next == len(self._tasks):
                return None
            self._next += 1
            return self._next - 1
