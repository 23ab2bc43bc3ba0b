"""The connection: finds the service, listens, and tries again when it is gone. The run does not notice.

A link belongs to the rig that it first attached to. The service of another rig is only offered (`ScreenState.offer`)
until a person accepts the change. The emergency stop needs no open connection: it makes one where it must.
"""

import asyncio
from contextlib import AsyncExitStack
from dataclasses import dataclass
from pathlib import Path

from drivers.clock import within
from drivers.ports import Clock
from fidim_lab.app.formats.run_spec import NAME as RUN
from fidim_lab.app.service.client import ServiceClient, connect
from fidim_lab.app.service.commands import Command, EmergencyStop
from fidim_lab.app.service.lock import Holder, running
from fidim_lab.app.service.messages import Answer, Welcome
from fidim_lab.app.service.own_process import serves
from fidim_lab.app.service.place import ServicePlace, all_places, places_of
from fidim_lab.app.tui.aside import Aside
from fidim_lab.app.tui.view import ScreenState, Tracker
from fidim_lab.data.rigs.rig import RigFile
from fidim_lab.errors import FidimError, HardwareError

AGAIN = 1.0
"""s between two attempts to connect"""
ANSWER_WITHIN = 1.5
"""s in which a service answers; it does so at once, or something is wrong"""
GREETS_WITHIN = 5.0
"""s in which a service greets a new client; a busy one still does"""
NAME = "fidim ui"
STOP = EmergencyStop(reason="key")


@dataclass(frozen=True)
class FoundService:
    """A service that listens, or why there is none."""

    socket: Path | None
    why: str = ""
    who: Holder | None = None
    """whose it is, where that was asked"""
    several: tuple[Path, ...] = ()
    """where one cannot be chosen"""


@dataclass(frozen=True)
class Finder:
    """`look` whenever a connection is wanted; at most one of the two is given, neither means the only service."""

    rig: RigFile | None = None
    folder: Path | None = None
    socket: Path | None = None
    """known already"""

    def look(self, known: Path | None = None) -> FoundService:
        """The socket to connect to now; known: chosen before, and again where several are there."""
        if self.socket is not None:
            return FoundService(self.socket)
        if self.rig is not None:
            why = f"{self.rig.path}: no service has this rig. fidim run PLAN --rig … starts one"
            return _one(places_of(self.rig), why, known)
        places = all_places()
        if self.folder is not None:
            places = [place for place, who in running(places) if serves(who, self.folder)]
            why = f"{self.folder}: no service runs in this folder now"
            left = ". r starts it again, to continue its run" if (self.folder / RUN).is_file() else ""
            return _one(places, why + left, known)
        why = "no service is running. fidim run PLAN --rig RIG starts one; fidim ui FOLDER, then r, continues a run"
        return _one(places, why, known)


class Link:
    """One UI's way to the service. `run` is a task for as long as the UI lives."""

    def __init__(self, finder: Finder, clock: Clock) -> None:
        self.tracker = Tracker()
        self._finder = finder
        self._clock = clock
        self._aside = Aside(clock)
        self._service: ServiceClient | None = None
        self._socket: Path | None = None
        """of the rig that this screen belongs to"""
        self.rig = ""
        """its name"""
        self._offered: FoundService | None = None
        """another rig's service"""

    def view(self) -> ScreenState:
        """What is known now."""
        return self.tracker.view(self._clock.now())

    async def run(self) -> None:
        """Connect, listen, and again, until cancelled. No fault of a service or file ends it."""
        while True:
            try:
                await self._attach()
            except FidimError as error:
                self.tracker.lose(str(error))
            except Exception as error:
                self.tracker.lose(f"{type(error).__name__}: {error}")
            await self._clock.sleep(AGAIN)

    async def command(self, command: Command) -> Answer:
        """Give a command. Raises HardwareError where nobody answers it."""
        service = self._service
        if service is None:
            raise HardwareError("There is no connection to a service.")
        return await self._answered(service, command)

    async def stop(self) -> Answer:
        """The emergency stop, by the open connection or by one of its own. Raises FidimError where nobody answers it.

        A screen that belongs to no rig yet stops every service that it could belong to.
        """
        if self._service is not None:
            return await self._answered(self._service, STOP)
        try:
            return await within(self._clock, ANSWER_WITHIN, self._stopped_apart())
        except TimeoutError:
            raise HardwareError(f"No service has answered within {ANSWER_WITHIN:g} s.") from None

    def change_rig(self) -> None:
        """A person accepts what was offered."""
        if self._offered is not None:
            self._socket, self.rig, self._offered = self._offered.socket, "", None
            self.tracker = Tracker()

    async def _attach(self) -> None:
        found = await self._aside.run(lambda: self._finder.look(self._socket))
        if found.socket is None:
            self._withdraw_offer()
            self.tracker.lose(found.why)
        elif found != self._offered:
            self._withdraw_offer()
            await self._listen(found, found.socket)

    async def _listen(self, found: FoundService, socket: Path) -> None:
        async with AsyncExitStack() as stack:
            service = await self._greeted(stack, socket)
            if self._is_another_rig(socket, service.welcome):
                self._offered = found
                self.tracker.offer(service.welcome)
                return
            self._service = service
            try:
                async for message in service:
                    self.tracker.take(message, self._clock.now())
            finally:
                self._service = None
        self.tracker.lose("The connection was lost: the service was killed, or disconnected this screen. Trying again.")

    async def _greeted(self, stack: AsyncExitStack, socket: Path) -> ServiceClient:
        try:
            connecting = stack.enter_async_context(connect(socket, name=NAME))
            return await within(self._clock, GREETS_WITHIN, connecting)
        except TimeoutError:
            what = f"A service is running ({socket}), but did not answer this screen within {GREETS_WITHIN:g} s."
            raise HardwareError(what) from None

    def _is_another_rig(self, socket: Path, welcome: Welcome | None) -> bool:
        """Whether this screen belongs to another one; it belongs to the first that it meets."""
        name = "" if welcome is None else welcome.rig
        if self._socket in (None, socket) and self.rig in ("", name):
            self._socket, self.rig = socket, name
            return False
        return True

    def _withdraw_offer(self) -> None:
        self._offered = None
        self.tracker.offer(None)

    async def _stopped_apart(self) -> Answer:
        sockets = (self._socket,) if self._socket is not None else await self._possible()
        told = await asyncio.gather(*map(self._stopped, sockets), return_exceptions=True)
        for one in told:
            if isinstance(one, BaseException):
                raise one
        answers = [one for one in told if isinstance(one, Answer)]
        return next((answer for answer in answers if not answer.ok), answers[0])

    async def _possible(self) -> tuple[Path, ...]:
        found = await Aside(self._clock).run(self._finder.look)  # one of its own: it waits for no other look
        sockets = found.several if found.socket is None else (found.socket,)
        if not sockets:
            raise HardwareError(found.why)
        return sockets

    async def _stopped(self, socket: Path) -> Answer:
        async with connect(socket, name=NAME, samples=False) as service:
            return await service.command(STOP)

    async def _answered(self, service: ServiceClient, command: Command) -> Answer:
        try:
            return await within(self._clock, ANSWER_WITHIN, service.command(command))
        except TimeoutError:
            raise HardwareError(f"The service has not answered within {ANSWER_WITHIN:g} s.") from None


def _one(places: list[ServicePlace], otherwise: str, known: Path | None) -> FoundService:
    there = [(place.socket, who) for place, who in running(places)]
    chosen = [found for found in there if found[0] == known] or there
    if not chosen:
        return FoundService(None, otherwise)
    if len(chosen) == 1:
        return FoundService(chosen[0][0], who=chosen[0][1])
    folders = ", ".join(who.folder for _, who in chosen)
    why = f"several services are running ({folders}): start fidim ui with the folder of one"
    return FoundService(None, why, several=tuple(socket for socket, _ in chosen))
