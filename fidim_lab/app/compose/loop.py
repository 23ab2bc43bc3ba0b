"""Running coroutines: loops that wait or jump, signals that end them gently, work that runs beside."""

import asyncio
import contextlib
import signal
import threading
from collections.abc import Coroutine, Generator
from types import FrameType
from typing import Any, TypeVar

from drivers.clock import precise_loop
from fidim_lab.errors import FidimError
from sim_backends.jumping_loop import run as run_jumping

T = TypeVar("T")

STOP_SIGNALS = tuple(
    signal.Signals[name] for name in ("SIGINT", "SIGTERM", "SIGHUP") if name in signal.Signals.__members__
)
"""Ctrl-C, a polite kill, and a terminal that is closed: the robot is held first"""


def run_loop(main: Coroutine[Any, Any, T], *, real_time: bool) -> T:
    """Run a coroutine on a loop that waits, or on one whose clock jumps.

    Ctrl-C and polite kills, however many, cancel it and let it end by itself, with its devices still being served;
    then KeyboardInterrupt. (asyncio by itself ends all tasks at the second one, the drives' control loop among them.)
    """
    heard: list[int] = []

    async def cancellable() -> T:
        with _cancelled_by_signals(heard):
            return await main

    try:
        if not real_time:
            return run_jumping(cancellable())
        with asyncio.Runner(loop_factory=precise_loop) as runner:
            return runner.run(cancellable())
    except asyncio.CancelledError:
        if heard:
            raise KeyboardInterrupt from None
        raise


@contextlib.contextmanager
def _cancelled_by_signals(heard: list[int]) -> Generator[None]:
    """Let signals cancel the present task, and note them; only the main thread gets any."""
    task, loop = asyncio.current_task(), asyncio.get_running_loop()
    if task is None or threading.current_thread() is not threading.main_thread():
        yield
        return

    def hear(number: int, _frame: FrameType | None) -> None:
        heard.append(number)
        loop.call_soon_threadsafe(task.cancel)

    before = {number: signal.signal(number, hear) for number in STOP_SIGNALS}
    try:
        yield
    finally:
        for number, handler in before.items():
            if handler is not None:  # None: one that was not set from Python
                signal.signal(number, handler)


async def running(stack: contextlib.AsyncExitStack, work: Coroutine[Any, Any, Any]) -> None:
    """Run something beside, until the context ends.

    That a device or the bus ended it shows in the values that it no longer brings; a bug is raised when the context
    ends, after whatever is in it has brought the robot to rest.
    """
    task = asyncio.ensure_future(work)

    async def end() -> None:
        task.cancel()
        (ended,) = await asyncio.gather(task, return_exceptions=True)
        if isinstance(ended, Exception) and not isinstance(ended, FidimError):
            raise ended

    stack.push_async_callback(end)
