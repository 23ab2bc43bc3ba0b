"""Independent pieces of numerical work on all cores of the machine, in threads.

CasADi's functions and numpy's linear algebra let go of Python's lock while they compute; what is mostly Python gains
nothing here. Results are those of one core, to the bit.
"""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

T = TypeVar("T")

MOST = 4
"""threads: beyond, Python's lock is what they wait for"""


def side_by_side(tasks: Sequence[Callable[[], T]]) -> list[T]:
    """What the tasks return, in their order. The first runs alone: it makes what all of them share."""
    if len(tasks) < 3 or cores() == 1:
        return [task() for task in tasks]

    def done(task: Callable[[], T]) -> T:
        return task()

    first = tasks[0]()
    with ThreadPoolExecutor(min(MOST, cores())) as pool:
        return [first, *pool.map(done, tasks[1:])]


def cores() -> int:
    """That this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
