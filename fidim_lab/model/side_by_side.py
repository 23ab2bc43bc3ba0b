"""Independent pieces of numerical work on all cores of the machine, in threads (OPENBLAS_NUM_THREADS=1 suits that).

CasADi's functions and numpy's linear algebra let go of Python's lock while they compute; what is mostly Python gains
nothing here. Results are those of one core, to the bit.
"""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextvars import Context, copy_context
from typing import TypeVar

T = TypeVar("T")

MOST = 4
"""threads: beyond, Python's lock is what they wait for"""


def side_by_side(tasks: Sequence[Callable[[], T]]) -> list[T]:
    """What the tasks return, in their order."""
    if len(tasks) < 2 or cores() == 1:
        return [task() for task in tasks]

    def done(task: Callable[[], T], here: Context) -> T:
        return here.run(task)

    contexts = [copy_context() for _ in tasks]  # what numpy is to ignore is said in the caller's
    with ThreadPoolExecutor(min(MOST, cores(), len(tasks))) as pool:
        return list(pool.map(done, tasks, contexts))


def cores() -> int:
    """That this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
