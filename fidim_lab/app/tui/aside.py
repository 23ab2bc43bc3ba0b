"""Work with files aside from the event loop: a file that does not answer (a stalled share) holds up no key.

A thread that waits for such a file cannot be ended. It is left alone and ends with the process; until it has ended,
nothing more is started, so that there is never more than one.
"""

import asyncio
import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, TypeVar

from drivers.clock import within
from drivers.ports import Clock
from fidim_lab.errors import SetupError

T = TypeVar("T")

PATIENCE = 2.0
"""s that files are waited for"""


class StalledError(SetupError):
    """Files have not answered in time."""

    def __init__(self, seconds: float) -> None:
        super().__init__(f"Files have not answered for {seconds:.0f} s: a stalled share or disk?")


class Aside:
    """One piece of work at a time, in a thread."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._work: Future[Any] | None = None
        self._begun = 0.0

    async def run(self, work: Callable[[], T]) -> T:
        """What `work` returns or raises. Raises StalledError where it, or the work before it, does not end."""
        if self._work is not None and not self._work.done():
            raise StalledError(self._clock.now() - self._begun)
        self._work, self._begun = _started(work), self._clock.now()
        try:
            return await within(self._clock, PATIENCE, _result(self._work))
        except TimeoutError:
            raise StalledError(self._clock.now() - self._begun) from None


def _started(work: Callable[[], T]) -> Future[T]:
    done: Future[T] = Future()
    done.set_running_or_notify_cancel()  # nobody can cancel it any more: it would still run

    def call() -> None:
        try:
            done.set_result(work())
        except BaseException as error:
            done.set_exception(error)

    threading.Thread(target=call, name="files", daemon=True).start()
    return done


async def _result(work: Future[T]) -> T:
    return await asyncio.wrap_future(work)
