r"""An operator at the other end of a socket: `fidim simulators` puts its simulated hand there.

One JSON object a line, both ways:  {"id": 1, "kind": "steady", "text": "…", "choices": ["done", …], "displacement": []}
is answered by {"id": 1, "answer": "done"}, or {"id": 1, "error": "…"} where it cannot be done.
"""

import asyncio
import json

from drivers.ports import Prompt
from fidim_lab.errors import DeviceError


class RemoteOperator:
    """`Operator` port over TCP. One prompt at a time; a connection that is lost is an error, never an answer."""

    def __init__(self, host: str, port: int) -> None:
        self._address = (host, port)
        self._streams: tuple[asyncio.StreamReader, asyncio.StreamWriter] | None = None
        self._asked = 0

    @property
    def name(self) -> str:
        """For messages."""
        return f"simulated hand {self._address[0]}:{self._address[1]}"

    async def open(self) -> None:
        """Connect. Raises DeviceError where nobody listens."""
        try:
            self._streams = await asyncio.open_connection(*self._address)
        except OSError as error:
            raise DeviceError(
                self.name, f"cannot connect: {error.strerror or error}.", hint="Is `fidim simulators` running?"
            ) from error

    async def close(self) -> None:
        """Hang up; may be called twice."""
        if self._streams is not None:
            self._streams[1].close()
            self._streams = None

    async def answer(self, prompt: Prompt) -> str:
        """The other end's answer. Raises DeviceError where the connection is lost or the answer is invalid."""
        if self._streams is None:
            raise DeviceError(self.name, "is not connected.")
        reader, writer = self._streams
        self._asked += 1
        question = {
            "id": self._asked,
            "kind": prompt.kind.value,
            "text": prompt.text,
            "choices": prompt.choices,
            "displacement": prompt.displacement,
        }
        try:
            writer.write(json.dumps(question).encode() + b"\n")
            await writer.drain()
            while True:
                line = await reader.readline()
                if not line:
                    raise DeviceError(self.name, "the connection was lost while a prompt was open.")
                if (answer := self._answer(line, prompt)) is not None:
                    return answer
        except OSError as error:
            raise DeviceError(self.name, f"the connection was lost: {error.strerror or error}.") from error

    def _answer(self, line: bytes, prompt: Prompt) -> str | None:
        """The answer in a line; None where it belongs to an earlier prompt, which was given up."""
        try:
            message = json.loads(line)
            number, error, answer = message["id"], message.get("error"), message.get("answer")
        except (ValueError, LookupError, TypeError, AttributeError) as problem:
            raise DeviceError(self.name, f"{line[:60]!r} is not an answer.") from problem
        if number != self._asked:
            return None
        if error is not None:
            raise DeviceError(self.name, str(error))
        if answer not in prompt.choices:
            raise DeviceError(self.name, f"{answer!r} is not one of {', '.join(prompt.choices)}.")
        return str(answer)
