"""The connection: finds the service, listens, and tries again when it is gone. The run does not notice."""

from pathlib import Path

from drivers.ports import Clock
from fidim_lab.app.service.client import ServiceClient, connect
from fidim_lab.app.service.commands import Command
from fidim_lab.app.service.messages import Answer
from fidim_lab.app.tui.find import Finder
from fidim_lab.app.tui.view import Tracker, View
from fidim_lab.errors import FidimError, HardwareError
from procedures.timing import within

AGAIN = 1.0
"""s between two attempts to connect"""
ANSWER_WITHIN = 1.5
"""s in which a service answers; it does so at once, or something is wrong"""
NAME = "fidim ui"


class Link:
    """One UI's way to the service. `run` is a task for as long as the UI lives."""

    def __init__(self, finder: Finder, clock: Clock) -> None:
        self.tracker = Tracker()
        self._finder = finder
        self._clock = clock
        self._service: ServiceClient | None = None

    def view(self) -> View:
        """What is known now."""
        return self.tracker.view(self._clock.now())

    async def run(self) -> None:
        """Connect, listen, and again, until cancelled."""
        while True:
            try:
                found = self._finder.look()
                if found.socket is None:
                    self.tracker.lose(found.why)
                else:
                    await self._listen(found.socket)
            except FidimError as error:
                self.tracker.lose(str(error))
            await self._clock.sleep(AGAIN)

    async def command(self, command: Command) -> Answer:
        """Give a command. Raises HardwareError where nobody answers it."""
        service = self._service
        if service is None:
            raise HardwareError("There is no connection to a service.")
        try:
            return await within(self._clock, ANSWER_WITHIN, service.command(command))
        except TimeoutError:
            raise HardwareError(f"The service has not answered within {ANSWER_WITHIN:g} s.") from None

    async def _listen(self, socket: Path) -> None:
        async with connect(socket, name=NAME) as service:
            self._service = service
            try:
                async for message in service:
                    self.tracker.take(message, self._clock.now())
            finally:
                self._service = None
        self.tracker.lose("The connection has ended: the service was killed, or it dropped this screen. Trying again.")
