"""Waiting with the Clock port: for a condition, and for work that a cancellation cannot cut short."""

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any, TypeVar

import drivers.clock
from drivers.ports import Clock

T = TypeVar("T")

POLL = 0.01
"""s between two looks at a device's newest sample"""


async def wait_until(clock: Clock, seconds: float, condition: Callable[[], bool]) -> bool:
    """Look until `condition` holds; False when it does not within `seconds`."""
    return await drivers.clock.wait_until(clock, condition, timeout=seconds, period=POLL)


async def uninterrupted(work: Coroutine[Any, Any, T]) -> T:
    """Run `work` to its end whatever is cancelled meanwhile; the cancellation is raised afterwards.

    A cancellation that reaches the inner task itself (an event loop being closed) is `work`'s own matter.
    """
    task = asyncio.ensure_future(work)
    cancelled: asyncio.CancelledError | None = None
    while not task.done():
        try:
            await asyncio.shield(task)
        except asyncio.CancelledError as error:
            cancelled = error
        except Exception:
            break  # raised by task.result() below
    if cancelled is not None and not task.cancelled() and task.exception() is None:
        raise cancelled
    return task.result()
