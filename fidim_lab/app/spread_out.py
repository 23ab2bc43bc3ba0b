"""Many independent computations on local processes, or on a dask cluster, with the same results in the same order."""

import multiprocessing
import os
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from typing import Any, TypeVar

from fidim_lab.errors import SetupError

T = TypeVar("T")
R = TypeVar("R")
Map = Callable[[Callable[[Any], Any], Iterable[Any]], Iterable[Any]]


@contextmanager
def workers(count: int | None = None, scheduler: str | None = None) -> Generator[Map]:
    """A map that computes elsewhere, in order: `count` local processes (default: one a core), or dask's workers.

    Raises SetupError where the scheduler cannot be reached or dask is not installed.
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
    with ProcessPoolExecutor(count, mp_context=multiprocessing.get_context("spawn"), initializer=_one_thread) as pool:
        yield pool.map


def _one_thread() -> None:
    """Processes share the cores already."""
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ[name] = "1"


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
            futures = client.map(action, list(tasks), pure=False)
            return (future.result() for future in futures)

        yield spread
