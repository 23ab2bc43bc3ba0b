"""The clock of the running event loop. With a loop that jumps (simulation) it jumps; with the usual one it waits.

`precise_loop` makes the loop for real time: asyncio's own waits in whole milliseconds, rounded up, and a SYNC of 250 Hz
came at 225 to 230 Hz by it.
"""

import asyncio
import select
import selectors
from collections.abc import Callable, Coroutine
from typing import Any, TypeVar

from drivers.ports import Clock

T = TypeVar("T")

_SELECTABLE = 1024
"""file descriptors below can be given to select()"""


class LoopClock:
    """`Clock` port on asyncio: `loop.time()` is monotonic, and the loop decides what a second costs."""

    def now(self) -> float:
        """Monotonic seconds of the running loop."""
        return asyncio.get_running_loop().time()

    async def sleep(self, seconds: float) -> None:
        """Let at least `seconds` pass."""
        await asyncio.sleep(max(seconds, 0.0))  # noqa: TID251 - this is the one place


async def wait_until(clock: Clock, condition: Callable[[], bool], *, timeout: float, period: float) -> bool:
    """Whether `condition` came true within `timeout` (s), looking every `period` (s). The condition may raise."""
    deadline = clock.now() + timeout
    while not condition():
        if clock.now() >= deadline:
            return False
        await clock.sleep(period)
    return True


async def within(clock: Clock, seconds: float, work: Coroutine[Any, Any, T]) -> T:
    """The result of `work`. Raises TimeoutError when it takes longer; cancels it then, and when cancelled itself."""
    task = asyncio.ensure_future(work)
    timer = asyncio.ensure_future(clock.sleep(seconds))
    try:
        await asyncio.wait({task, timer}, return_when=asyncio.FIRST_COMPLETED)
        if not task.done():
            raise TimeoutError
        return task.result()
    finally:
        timer.cancel()
        task.cancel()


def precise_loop() -> asyncio.AbstractEventLoop:
    """An event loop whose waits end within the system's timer slack (50 µs on Linux); asyncio's own without epoll."""
    if not hasattr(selectors, "EpollSelector"):
        return asyncio.new_event_loop()
    return asyncio.SelectorEventLoop(_PreciseSelector())


if hasattr(selectors, "EpollSelector"):

    class _PreciseSelector(selectors.EpollSelector):
        """Waits by select(), which takes microseconds, for the one file descriptor that stands for all others."""

        def select(self, timeout: float | None = None) -> "list[tuple[selectors.SelectorKey, int]]":
            """As any selector's."""
            if timeout is not None and timeout > 0.0 and self.fileno() < _SELECTABLE:
                select.select((self.fileno(),), (), (), timeout)
                timeout = 0.0
            return super().select(timeout)
