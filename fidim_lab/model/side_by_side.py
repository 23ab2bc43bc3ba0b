"""Independent pieces of numerical work on all cores of the machine, in threads (OPENBLAS_NUM_THREADS=1 suits that).

CasADi's functions and numpy's linear algebra let go of Python's lock while they compute; what is mostly Python gains
nothing here. The larger the pieces the better: whole fits rather than the batches of windows within one. Pieces within
pieces share the cores that the outer ones leave. Results are those of one core, to the bit.
"""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextvars import Context, ContextVar, copy_context
from typing import TypeVar

T = TypeVar("T")

MOST = 4
"""threads: beyond, Python's lock is what they wait for"""
_SHARE: ContextVar[int] = ContextVar("share of the cores")
"""how many a piece of work may use; unset outside of any"""


def side_by_side(tasks: Sequence[Callable[[], T]]) -> list[T]:
    """What the tasks return, in their order."""
    share = _SHARE.get(min(MOST, cores()))
    threads = min(share, len(tasks))
    if threads < 2:
        return [task() for task in tasks]

    def done(task: Callable[[], T], here: Context) -> T:
        here.run(_SHARE.set, share // threads)
        return here.run(task)

    contexts = [copy_context() for _ in tasks]  # what numpy is to ignore is said in the caller's
    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(done, tasks, contexts))


def found_side_by_side(tasks: Sequence[Callable[[], T | None]]) -> list[T]:
    """What those of them return that find something, in their order."""
    return [found for found in side_by_side(tasks) if found is not None]


def cores() -> int:
    """That this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
