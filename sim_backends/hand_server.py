"""The simulated hand on a socket: prompts in, answers out, one JSON object a line (see `drivers.remote_operator`)."""

import asyncio
import contextlib
import json

from drivers.ports import Operator, Prompt, PromptKind
from fidim_lab.errors import FidimError, SetupError


class HandServer:
    """Lets whoever connects have prompts answered, one after the other."""

    def __init__(self, hand: Operator, host: str, port: int) -> None:
        self._hand = hand
        self._address = (host, port)
        self._listener: asyncio.Server | None = None
        self._talks: set[asyncio.Task[None]] = set()

    @property
    def port(self) -> int:
        """Where it listens, once started."""
        return self._address[1]

    async def start(self) -> None:
        """Listen. Raises SetupError where the address is taken or not this computer's."""
        host, port = self._address
        try:
            self._listener = await asyncio.start_server(self._connected, host, port)
        except OSError as error:
            raise SetupError(
                f"simulated hand {host}:{port}: cannot listen there: {error.strerror or error}."
            ) from error
        self._address = (host, self._listener.sockets[0].getsockname()[1])

    async def close(self) -> None:
        """Stop listening, and hang up; may be called twice."""
        listener, self._listener = self._listener, None
        if listener is None:
            return
        listener.close()
        for talk in tuple(self._talks):
            talk.cancel()
        await asyncio.gather(*self._talks, return_exceptions=True)
        await listener.wait_closed()

    async def _connected(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        talk = asyncio.current_task()
        if talk is not None:
            self._talks.add(talk)
            talk.add_done_callback(self._talks.discard)
        try:
            while line := await reader.readline():
                writer.write(json.dumps(await self._reply(line)).encode() + b"\n")
                await writer.drain()
        except (OSError, ValueError, asyncio.CancelledError):
            pass  # gone, or a line without end; the next one may come
        finally:
            writer.close()
            with contextlib.suppress(OSError, asyncio.CancelledError):
                await writer.wait_closed()

    async def _reply(self, line: bytes) -> dict[str, object]:
        number: object = None
        try:
            message = json.loads(line)
            number = message["id"]
            prompt = Prompt(
                PromptKind(message["kind"]),
                str(message["text"]),
                tuple(str(choice) for choice in message["choices"]),
                tuple(float(value) for value in message["displacement"]),
            )
        except (ValueError, LookupError, TypeError) as error:
            return {"id": number, "error": f"{line[:60]!r} is not a prompt: {error}"}
        try:
            return {"id": number, "answer": await self._hand.answer(prompt)}
        except FidimError as error:
            return {"id": number, "error": str(error)}
