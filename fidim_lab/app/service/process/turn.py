"""The one run of a service: waited for, begun by a client, never begun twice."""

import asyncio
from collections.abc import Awaitable, Callable

from drivers.ports import Clock
from procedures.report import RunReport

LONELY = 120.0
"""s after which a service that nobody has started, and at which nobody looks, ends"""
LOOK = 0.05
"""s"""


class Turn:
    """Whether the run is to begin, goes on, or has ended."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._started = asyncio.Event()
        self._ending = asyncio.Event()
        self._running = False
        self._ended = False

    def start(self) -> str:
        """Begin; returns why not, empty where it does."""
        if self._running or self._started.is_set():
            return "the run has begun already"
        if self._ended:
            return "the run has ended; fidim resume continues it"
        self._started.set()
        return ""

    def shutdown(self) -> str:
        """End the service; returns why not."""
        if self._running:
            return "a run is in progress; abort it first"
        self._ending.set()
        return ""

    async def comes(self, clients: Callable[[], int]) -> bool:
        """Wait; True when a run is to begin, False when the service is to end. clients: how many are connected."""
        since = self._clock.now()
        while not self._started.is_set():
            if clients():
                since = self._clock.now()
            if self._ending.is_set() or self._clock.now() - since > LONELY:
                return False
            await self._clock.sleep(LOOK)
        return True

    async def take(self, run: Awaitable[RunReport]) -> RunReport:
        """Carry it out."""
        self._running = True
        try:
            return await run
        finally:
            self._running, self._ended = False, True
            self._started.clear()
