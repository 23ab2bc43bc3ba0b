"""A bounded queue from callbacks or one task to one reading task: nothing is dropped without an error.

asyncio.Queue would do for the queue; what it lacks is a place for errors among the values and an end that says why.
"""

import asyncio
from collections import deque
from typing import Generic, TypeVar

from fidim_lab.errors import FidimError, OurBugError

T = TypeVar("T")


class MailboxClosedError(Exception):
    """There will be no more values (control flow, never shown to a user)."""


class Mailbox(Generic[T]):
    """Values and errors in order; one reader. A full mailbox takes no more: the writer is told and decides."""

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._items: deque[T | FidimError] = deque()
        self._waiter: asyncio.Future[None] | None = None
        self._closed = False

    def put(self, item: T) -> bool:
        """Append a value; False where the mailbox is full or closed and the value was not taken."""
        if self._closed or len(self._items) >= self._limit:
            return False
        self._items.append(item)
        self._wake()
        return True

    def fail(self, error: FidimError) -> None:
        """Append an error: the reader gets the values before it, then the error, then what follows."""
        if not self._closed:
            self._items.append(error)
            self._wake()

    def close(self) -> None:
        """No more values; the reader gets what is left, then MailboxClosedError."""
        self._closed = True
        self._wake()

    async def get(self) -> T:
        """The next value, once there is one. Raises the error that stands there, or MailboxClosedError at the end."""
        while not self._items:
            if self._closed:
                raise MailboxClosedError
            if self._waiter is not None:
                raise OurBugError("two tasks read one subscription", hint="Subscribe once for each reader.")
            self._waiter = asyncio.get_running_loop().create_future()
            try:
                await self._waiter
            finally:
                self._waiter = None
        item = self._items.popleft()
        if isinstance(item, FidimError):
            raise item.with_traceback(None)
        return item

    def _wake(self) -> None:
        if self._waiter is not None and not self._waiter.done():
            self._waiter.set_result(None)
