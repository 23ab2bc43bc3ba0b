"""Handing frames to several readers, each at its own pace: `FrameBroadcast` writes, a `Subscription` is read."""

import weakref

from drivers.mocap.mailbox import Mailbox, MailboxClosedError
from drivers.ports import MarkerFrame
from fidim_lab.errors import DeviceError, FidimError


class Subscription:
    """Every frame from the moment of subscription, in order; errors in their place; ends when the source closes.

    One task reads it. Just drop it to unsubscribe.
    """

    def __init__(self, device: str, limit: int) -> None:
        self._device = device
        self._limit = limit
        self._mailbox: Mailbox[MarkerFrame] = Mailbox(limit)
        self._overflown = False

    def __aiter__(self) -> "Subscription":
        return self

    async def __anext__(self) -> MarkerFrame:
        try:
            return await self._mailbox.get()
        except MailboxClosedError:
            raise StopAsyncIteration from None

    def deliver(self, frame: MarkerFrame) -> bool:
        """Append a frame. False when full: then the reader gets what is there, an error, and nothing after the hole."""
        if self._mailbox.put(frame):
            return True
        if not self._overflown:
            self._overflown = True
            problem = f"its reader fell {self._limit} frames behind; frames from number {frame.number} on are missing."
            hint = "The computer is too slow or was stopped; record the window again."
            self.fail(DeviceError(self._device, problem, hint=hint))
            self.close()
        return False

    def fail(self, error: FidimError) -> None:
        """Append an error."""
        self._mailbox.fail(error)

    def close(self) -> None:
        """End after what is there."""
        self._mailbox.close()


class FrameBroadcast:
    """All present subscriptions. It holds them weakly: a reader that is gone costs nothing and fills nothing."""

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._references: list[weakref.ref[Subscription]] = []
        self.overflow = 0
        """frames that slow readers did not get"""

    def subscribe(self, device: str) -> Subscription:
        """A reader of all that is delivered from now on; `device` is named in its errors."""
        subscription = Subscription(device, self._limit)
        self._references.append(weakref.ref(subscription, self._references.remove))
        return subscription

    def deliver(self, frame: MarkerFrame) -> None:
        """Hand a frame to every reader."""
        for subscription in self._present():
            if not subscription.deliver(frame):
                self.overflow += 1

    def fail(self, error: FidimError) -> None:
        """Hand an error to every reader."""
        for subscription in self._present():
            subscription.fail(error)

    def close(self) -> None:
        """End every reader after what it has."""
        for subscription in self._present():
            subscription.close()

    def _present(self) -> list[Subscription]:
        return [reader for reference in self._references if (reader := reference()) is not None]
