"""An event loop whose clock jumps: simulated minutes pass in milliseconds, the same way every time.

Use `run(main())` for a whole simulated experiment. Everything that waits on the loop's time (`loop.time()`,
`asyncio.wait_for`, `asyncio.timeout`, the `Clock` port `drivers.clock.LoopClock`) then waits in virtual seconds.
"""

import asyncio
import selectors
from collections.abc import Callable, Coroutine
from typing import Any, TypeVar

T = TypeVar("T")


class _JumpingSelector(selectors.DefaultSelector):
    """Where the loop would wait for a timer, asks once for I/O and signals, and lets the time jump instead."""

    def __init__(self, jump: Callable[[float], bool]) -> None:
        super().__init__()
        self._jump = jump

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        """Events that are there now; with none, the time jumps by `timeout`, or this waits where it must not jump."""
        events = super().select(0)
        if events or (timeout is not None and timeout <= 0):
            return events
        if timeout is not None and self._jump(timeout):
            return events
        return super().select(None)


class JumpingEventLoop(asyncio.SelectorEventLoop):
    """asyncio on a virtual clock that starts at 0 and jumps to the next timer whenever nothing is ready to run.

    Order is that of asyncio: by time, and by order of creation at the same time. Signals (Ctrl-C) and sockets are
    looked at before each jump; with no timer left the loop waits for them as usual. While a thread of
    `run_in_executor` works, the time stands still, so that real work takes no simulated time.
    Not simulated: how long the code itself takes (a callback costs 0 s). Peers outside this process live in
    real time: a time-out on a socket ends at once here unless its answer is there already.
    """

    def __init__(self) -> None:
        self._virtual = 0.0
        self._working = 0
        """calls in executor threads"""
        super().__init__(_JumpingSelector(self._advance))

    def time(self) -> float:
        """Virtual seconds since the loop was made."""
        return self._virtual

    def run_in_executor(self, executor: Any, func: Callable[..., Any], *args: Any) -> "asyncio.Future[Any]":
        """As usual, but the clock does not jump before `func` has returned."""
        future = super().run_in_executor(executor, func, *args)
        self._working += 1
        future.add_done_callback(self._worked)
        return future

    async def shutdown_default_executor(self, timeout: float | None = None) -> None:
        """As usual, without time-out: in virtual time it would be over before any thread can end."""
        self._working += 1
        try:
            await super().shutdown_default_executor()
        finally:
            self._working -= 1

    def _worked(self, _future: "asyncio.Future[Any]") -> None:
        self._working -= 1

    def _advance(self, seconds: float) -> bool:
        if self._working:
            return False
        self._virtual += seconds
        return True


def run(main: Coroutine[Any, Any, T], *, debug: bool | None = None) -> T:
    """As `asyncio.run`, on a `JumpingEventLoop`. Ctrl-C cancels `main`; then KeyboardInterrupt."""
    with asyncio.Runner(debug=debug, loop_factory=JumpingEventLoop) as runner:
        return runner.run(main)
