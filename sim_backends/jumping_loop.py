"""An event loop whose clock jumps: simulated minutes pass in milliseconds, the same way every time.

Use `run(main())` for a whole simulated experiment. Everything that waits on the loop's time (`loop.time()`,
`asyncio.wait_for`, `asyncio.timeout`, the `Clock` port `drivers.clock.LoopClock`) then waits in virtual seconds.
"""

import asyncio
import selectors
from collections import deque
from collections.abc import Callable, Coroutine
from typing import Any, TypeVar

T = TypeVar("T")


class _JumpingSelector(selectors.DefaultSelector):
    """Where the loop would wait for a timer, asks once for I/O and signals, and lets the time jump instead."""

    def __init__(self, idle: Callable[[float | None], bool]) -> None:
        super().__init__()
        self._idle = idle

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        """Events that are there now; with none, the loop goes on by itself (`idle`), or this waits for one."""
        events = super().select(0)
        if events or (timeout is not None and timeout <= 0) or self._idle(timeout):
            return events
        return super().select(None)


class JumpingEventLoop(asyncio.SelectorEventLoop):
    """asyncio on a virtual clock that starts at 0 and jumps to the next timer whenever nothing is ready to run.

    Order is that of asyncio: by time, and by order of creation at the same time. Signals (Ctrl-C) and sockets are
    looked at before each jump; with no timer left the loop waits for them as usual. While a thread of
    `run_in_executor` works, the time stands still, so that real work takes no simulated time; its answer comes when
    nothing else is left to do at that time, in the order of the calls, however long it took.
    Not simulated: how long the code itself takes (a callback costs 0 s). Peers outside this process live in
    real time: a time-out on a socket ends at once here unless its answer is there already.
    """

    def __init__(self) -> None:
        self._virtual = 0.0
        self._ending = False
        """threads are waited for at the end, whatever the time"""
        self._calls: deque[tuple[asyncio.Future[Any], asyncio.Future[Any]]] = deque()
        """work in executor threads: what the thread resolves, and what its caller waits for"""
        super().__init__(_JumpingSelector(self._idle))

    def time(self) -> float:
        """Virtual seconds since the loop was made."""
        return self._virtual

    def run_in_executor(self, executor: Any, func: Callable[..., Any], *args: Any) -> "asyncio.Future[Any]":
        """As usual, but the clock does not jump before `func` has returned, and the moment is always the same."""
        working, waiting = super().run_in_executor(executor, func, *args), self.create_future()
        waiting.add_done_callback(lambda ended: working.cancel() if ended.cancelled() else None)
        self._calls.append((working, waiting))
        return waiting

    async def shutdown_default_executor(self, timeout: float | None = None) -> None:
        """As usual, without time-out: in virtual time it would be over before any thread can end."""
        self._ending = True
        try:
            await super().shutdown_default_executor()
        finally:
            self._ending = False

    def _idle(self, seconds: float | None) -> bool:
        """Nothing is left to do now: tell what threads have found, or jump. Whether there is something to do again."""
        if self._calls and self._calls[0][0].done():
            _tell(*self._calls.popleft())
            return True
        if self._calls or self._ending or seconds is None:
            return False
        self._virtual += seconds
        return True


def _tell(working: "asyncio.Future[Any]", waiting: "asyncio.Future[Any]") -> None:
    """Hand a thread's answer to whoever waits for it."""
    problem = None if working.cancelled() else working.exception()
    if waiting.done():  # nobody waits any more
        return
    if working.cancelled():
        waiting.cancel()
    elif problem is not None:
        waiting.set_exception(problem)
    else:
        waiting.set_result(working.result())


def run(main: Coroutine[Any, Any, T], *, debug: bool | None = None) -> T:
    """As `asyncio.run`, on a `JumpingEventLoop`. Ctrl-C cancels `main`; then KeyboardInterrupt."""
    with asyncio.Runner(debug=debug, loop_factory=JumpingEventLoop) as runner:
        return runner.run(main)
