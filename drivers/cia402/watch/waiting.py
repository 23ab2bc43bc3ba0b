"""Waiting for a drive: look once a SYNC period, on the port's clock, with a time-out."""

from collections.abc import Callable

from drivers.ports import Clock


async def wait_until(clock: Clock, condition: Callable[[], bool], *, timeout: float, period: float) -> bool:
    """Whether `condition` came true within `timeout` (s), looking every `period` (s). The condition may raise."""
    deadline = clock.now() + timeout
    while not condition():
        if clock.now() >= deadline:
            return False
        await clock.sleep(period)
    return True
