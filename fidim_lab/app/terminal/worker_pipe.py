"""Both ends of the pipe to a worker's process: a line in is a request, a line of JSON out its answer.

`LineWorker` asks; `requests` are what the worker hears. The worker ends when whoever holds the pipe does: it computes
for seconds between two lines, and reading the next line only when the last is answered, it would go on computing for a
minute after its parent was killed.
"""

import asyncio
import json
import os
import sys
import threading
from collections.abc import Iterator
from contextlib import suppress
from queue import SimpleQueue
from typing import Any

CHUNK = 1 << 16


class LineWorker:
    """A worker, started by the first request; one request at a time."""

    def __init__(self, *arguments: str, longest: int) -> None:
        """arguments: of Python. longest: bytes of an answer at most."""
        self._arguments = arguments
        self._longest = longest
        self._process: asyncio.subprocess.Process | None = None

    @property
    def begun(self) -> bool:
        """Whether it was ever asked, and not ended since."""
        return self._process is not None

    async def answer(self, request: str) -> dict[str, Any]:
        """To one line. Raises OSError or ValueError, which says why there is none."""
        if self._process is None or self._process.returncode is not None:
            self._process = await asyncio.create_subprocess_exec(
                *(sys.executable, *self._arguments),
                stdin=asyncio.subprocess.PIPE,
                stdout=asyncio.subprocess.PIPE,
                stderr=asyncio.subprocess.DEVNULL,
                limit=self._longest,
                start_new_session=True,
                env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
            )
        process = self._process
        if process.stdin is None or process.stdout is None:
            raise ValueError("its process has no pipes")
        process.stdin.write(f"{request}\n".encode())
        await process.stdin.drain()
        line = await process.stdout.readline()
        if not line:
            raise ValueError(f"its process ended with exit code {await process.wait()}")
        answer: dict[str, Any] = json.loads(line)
        return answer

    async def end(self, within: float | None = None) -> None:
        """Kill it; s that its end is waited for: one that waits for a stalled share does not even end then."""
        process, self._process = self._process, None
        if process is not None:
            with suppress(ProcessLookupError):
                process.kill()
            with suppress(TimeoutError):
                await asyncio.wait_for(process.wait(), within)


def requests() -> Iterator[str]:
    """Each line as it arrives. The end of standard input ends this process at once."""
    lines: SimpleQueue[str] = SimpleQueue()
    threading.Thread(target=_read, args=(sys.stdin.fileno(), lines), name="standard input", daemon=True).start()
    while True:
        yield lines.get()


def _read(descriptor: int, lines: SimpleQueue[str]) -> None:
    """Not through sys.stdin: a thread that waits within its buffer's lock spoils the end of the interpreter."""
    rest = b""
    try:
        while data := os.read(descriptor, CHUNK):
            *whole, rest = (rest + data).split(b"\n")
            for line in whole:
                lines.put(line.decode())
    finally:
        os._exit(0)  # nobody is there for an answer, and nothing of a worker is on a disk
