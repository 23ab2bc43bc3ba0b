"""For whoever writes a user interface or a script: connect to a running service, listen, command.

    async with connect(path, name="my script") as service:
        await service.take_lease()
        await service.command(Pause(reason="lunch"))
        async for message in service:      # Welcome and History first, then Status, Happening, Question …
            ...

Messages wait in a bounded box while nobody reads them; the oldest `Status` and `Samples` are forgotten first, an
answer or a question never. A connection that ends closes the iteration; commands then raise `ServiceGoneError`.
"""

import asyncio
from collections import deque
from collections.abc import AsyncGenerator, AsyncIterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path

from fidim_lab.app.service.codec import LineDecoder, MalformedLine, encode
from fidim_lab.app.service.commands import (
    AnswerPrompt,
    Command,
    Hello,
    Message,
    Request,
    Reset,
    TakeLease,
)
from fidim_lab.app.service.latch import first_words
from fidim_lab.app.service.messages import (
    TO_CLIENT,
    Answer,
    Bye,
    History,
    Refusal,
    Samples,
    Status,
    Welcome,
)
from fidim_lab.errors import HardwareError, RefusedError, SetupError

BOX = 512
"""messages that wait for a slow reader"""
CHUNK = 1 << 16
LONGEST = 1 << 20
"""bytes of a line: a state of a large robot, a piece of history"""


class ServiceGoneError(HardwareError):
    """The service has ended, or was killed. Its drives stop by themselves when they miss its heartbeat."""


class ServiceClient:
    """One connection. Made by `connect`. An async iterator of everything that the service says but answers."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.welcome: Welcome | None = None
        """what the service said of itself"""
        self.status: Status | None = None
        """the newest state, whether or not it was read from the iterator"""
        self.history: History | None = None
        """what had happened before this client came"""
        self.bye: Bye | None = None
        """how the service ended, once it has"""
        self.lost = 0
        """messages forgotten because nobody read them"""
        self._reader = reader
        self._writer = writer
        self._box: deque[Message] = deque()
        self._arrived = asyncio.Event()
        self._greeted: asyncio.Future[Welcome] = asyncio.get_running_loop().create_future()
        self._waiting: dict[int, asyncio.Future[Answer]] = {}
        self._number = 0
        self._ended = ""

    async def command(self, command: Command) -> Answer:
        """Give a command; returns its answer (`ok`, `says`). Raises ServiceGoneError."""
        if self._ended:
            raise ServiceGoneError(self._ended)
        self._number += 1
        number = self._number
        self._waiting[number] = asyncio.get_running_loop().create_future()
        try:
            self._writer.write(encode(Request(id=number, command=command)))
            await self._writer.drain()
            return await self._waiting[number]
        except OSError as error:
            raise ServiceGoneError(f"The service's socket is closed: {error.strerror or error}.") from error
        finally:
            del self._waiting[number]

    async def require(self, command: Command) -> Answer:
        """As `command`. Raises RefusedError, with the service's words, where the answer is no."""
        answer = await self.command(command)
        if not answer.ok:
            raise RefusedError(f"{command.name}: {answer.says}.")
        return answer

    async def take_lease(self, *, force: bool = False) -> Answer:
        """Become the one client that commands. Raises RefusedError where another does."""
        return await self.require(TakeLease(force=force))

    async def reset(self, known: str = "") -> Answer:
        """Reset the latched emergency stop, both steps: only for who has asked a person.

        known: the stop that the person was asked about (as `latched_why`). Raises RefusedError, also where it is
        another one by now; empty: whichever it is.
        """
        first = await self.require(Reset())
        if known and first.code and first.says != first_words(known):
            raise RefusedError(f"The emergency stop was pressed meanwhile. {first.says}")
        return await self.require(Reset(code=first.code)) if first.code else first

    async def state(self) -> Status:
        """The newest state, waited for where none has come yet. Raises ServiceGoneError."""
        while self.status is None:
            if self._ended:
                raise ServiceGoneError(self._ended)
            self._arrived.clear()
            await self._arrived.wait()
        return self.status

    async def answer(self, prompt: int, choice: str) -> Answer:
        """Answer a prompt; `ok` is False where another client was first."""
        return await self.command(AnswerPrompt(prompt=prompt, choice=choice))

    def __aiter__(self) -> AsyncIterator[Message]:
        return self

    async def __anext__(self) -> Message:
        while not self._box:
            if self._ended:
                raise StopAsyncIteration
            self._arrived.clear()
            await self._arrived.wait()
        return self._box.popleft()

    async def greeted(self, hello: Hello) -> Welcome:
        """Say hello and wait for the welcome. Raises RefusedError with the service's words, or ServiceGoneError."""
        self._writer.write(encode(hello))
        return await self._greeted

    async def read(self) -> None:
        """Read until the connection ends; the connection's own task."""
        decoder = LineDecoder(TO_CLIENT, limit=LONGEST)
        try:
            while data := await self._reader.read(CHUNK):
                for message in decoder.receive(data):
                    self._take(message)
        except OSError:
            pass  # the service was killed: the same as its end
        finally:
            said = self.bye.says if self.bye else "its process was killed or has failed"
            self._end(f"The service has ended: {said}")

    def _take(self, message: Message | MalformedLine) -> None:
        match message:
            case MalformedLine(says):
                self._end(f"The service sent an invalid message: {says}")
                return
            case Answer():
                if (waiting := self._waiting.get(message.id)) is not None and not waiting.done():
                    waiting.set_result(message)
                return
            case Refusal():
                self._end(message.says)
            case Welcome():
                self.welcome = message
                if not self._greeted.done():
                    self._greeted.set_result(message)
            case History():
                before = self.history.events if self.history is not None else ()
                self.history = message.model_copy(update={"events": (*before, *message.events)})
            case Status():
                self.status = message
            case Bye():
                self.bye = message
            case _:
                pass
        self._put(message)

    def _put(self, message: Message) -> None:
        if len(self._box) >= BOX:
            old = next((m for m in self._box if isinstance(m, Status | Samples)), None)
            if old is not None:
                self._box.remove(old)
                self.lost += 1
        self._box.append(message)
        self._arrived.set()

    def _end(self, why: str) -> None:
        self._ended = self._ended or why
        gone = ServiceGoneError(self._ended)
        for waiting in (*self._waiting.values(), self._greeted):
            if not waiting.done():
                waiting.set_exception(gone)
                waiting.exception()  # seen: whoever waits gets it, nobody else is warned
        self._arrived.set()


@asynccontextmanager
async def connect(
    path: Path | None = None, *, port: int = 0, token: str = "", name: str = "", samples: bool = True
) -> AsyncGenerator[ServiceClient]:
    """Connect to a service at its socket, or at a TCP port of this computer with its token.

    Raises SetupError where nobody listens, ServiceGoneError (with the service's words) where it refuses.
    """
    try:
        if path is not None:
            reader, writer = await asyncio.open_unix_connection(path)
        else:
            reader, writer = await asyncio.open_connection("127.0.0.1", port)
    except OSError as error:
        where = str(path) if path is not None else f"port {port}"
        raise SetupError(f"{where}: no service listens there: {error.strerror or error}.") from error
    client = ServiceClient(reader, writer)
    reading = asyncio.ensure_future(client.read())
    try:
        await client.greeted(Hello(client=name, token=token, samples=samples))
        yield client
    finally:
        reading.cancel()
        writer.close()
        with suppress(OSError, asyncio.CancelledError):
            await asyncio.gather(reading, return_exceptions=True)
            await writer.wait_closed()
