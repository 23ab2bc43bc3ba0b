"""Many independent computations on local processes, or on a dask cluster, with the same results in the same order."""

import multiprocessing
import os
import signal
import sys
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager
from functools import partial
from itertools import islice
from types import FrameType
from typing import Any, Protocol, TypeVar

from fidim_lab.errors import SetupError
from fidim_lab.mapping import Map

T = TypeVar("T")
R = TypeVar("R")
AHEAD = 16
"""tasks a worker that are under way: one that takes long keeps no other waiting"""
MAIN = ("__file__", "__spec__")
"""of the main module: by these a new process finds it, to run it too"""


@contextmanager
def workers(count: int | None = None, scheduler: str | None = None) -> Generator[Map]:
    """A map that computes elsewhere, in order: `count` local processes (default: one a core), or dask's workers.

    An interruption ends local processes at once, whatever they compute. Raises SetupError where the scheduler cannot be
    reached or dask is not installed.
    """
    if scheduler is not None:
        with _cluster(scheduler) as spread:
            yield spread
        return
    count = count or os.cpu_count() or 1
    if count == 1:
        yield map
        return
    # fork would copy CasADi's and BLAS's threads in an unknown state
    with ProcessPoolExecutor(count, mp_context=multiprocessing.get_context("spawn"), initializer=_begin) as pool:
        try:
            yield lambda action, tasks: _in_order(partial(_submitted, pool, action), tasks, AHEAD * count)
        except KeyboardInterrupt:
            # no task is cancelled before: the pool's own thread would trip over it, and print that
            for process in multiprocessing.active_children():
                process.terminate()
            raise
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _begin() -> None:
    """Processes share the cores already, and Ctrl-C is for the command, which ends them."""
    # not SIG_IGN, which what they start would inherit
    signal.signal(signal.SIGINT, _unmoved)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    if sys.platform != "win32":
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ[name] = "1"


def _unmoved(number: int, frame: FrameType | None) -> None:
    pass


class _Promise(Protocol):
    def result(self) -> Any:
        """Waits for it."""
        ...


def _in_order(submit: Callable[[T], _Promise], tasks: Iterable[T], most: int) -> Iterator[Any]:
    """Results as they come, with so many tasks under way at most: these are made one by one, and may be large."""
    left = iter(tasks)
    under_way = deque(submit(task) for task in islice(left, most))
    while under_way:
        result = under_way.popleft().result()
        under_way.extend(submit(task) for task in islice(left, 1))
        yield result


def _submitted(pool: Executor, action: Callable[[T], R], task: T) -> Future[R]:
    with _held_back(), _not_run_again(action):
        return pool.submit(action, task)


@contextmanager
def _not_run_again(action: Callable[[T], R]) -> Generator[None]:
    """A process begun meanwhile does not run the program's main script as well, unless the action is a part of that."""
    while isinstance(action, partial):
        action = action.func
    main = vars(sys.modules["__main__"])
    shown = {} if action.__module__ == "__main__" else {key: main[key] for key in MAIN if key in main}
    main.update(dict.fromkeys(shown))
    try:
        yield
    finally:
        main.update(shown)


@contextmanager
def _held_back() -> Generator[None]:
    """Ctrl-C waits, also in processes begun meanwhile: until each is ready for it."""
    if sys.platform == "win32":
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _cluster(scheduler: str) -> Generator[Map]:
    try:
        from distributed import Client
    except ImportError as error:
        raise SetupError("--scheduler needs dask.", hint="pip install 'fidim-lab[cluster]'") from error
    try:
        client = Client(scheduler, timeout="10s")
    except (OSError, TimeoutError, ValueError) as error:
        raise SetupError(f"No dask scheduler answers at {scheduler}: {error}") from error
    with client:

        def spread(action: Callable[[T], R], tasks: Iterable[T]) -> Iterable[R]:
            threads: Any = client.nthreads()  # typed as if it were awaited
            return _in_order(partial(client.submit, action, pure=False), tasks, AHEAD * max(1, sum(threads.values())))

        yield spread
