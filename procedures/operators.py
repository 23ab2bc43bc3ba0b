"""A person at the console who answers prompts. It needs a loop that waits in real time."""

import asyncio
import os
import threading
from collections.abc import Callable

from drivers.ports import Prompt


class ConsoleOperator:
    """Asks on a terminal or pipe, and lets the event loop go on meanwhile.

    An empty line takes the first choice, the beginning of a choice is enough; the end of the input is “abort”. What was
    typed before a question was asked does not answer it.
    """

    def __init__(self, show: Callable[[str], None], descriptor: int = 0) -> None:
        self._show = show
        self._descriptor = descriptor
        self._lines: asyncio.Queue[str | None] = asyncio.Queue()
        self._started = False
        self._ended = False

    async def answer(self, prompt: Prompt) -> str:
        """One of the prompt's choices."""
        self._start()
        while not self._lines.empty():
            self._ended |= self._lines.get_nowait() is None
        choices = ", ".join(prompt.choices)
        while not self._ended:
            self._show(f"{prompt.text} [{choices}] ")
            line = await self._lines.get()
            if line is None:
                self._ended = True
                break
            fitting = [choice for choice in prompt.choices if choice.startswith(line.strip().lower())]
            if fitting:
                return fitting[0]
            self._show(f"“{line.strip()}” is not one of {choices}.\n")
        return "abort" if "abort" in prompt.choices else prompt.choices[-1]

    def _start(self) -> None:
        if not self._started:
            self._started = True
            # A daemon, reading below Python's own buffers: a pending read neither blocks exit nor owns stdin's lock.
            loop = asyncio.get_running_loop()
            threading.Thread(target=self._read, args=(loop,), name="console", daemon=True).start()

    def _read(self, loop: asyncio.AbstractEventLoop) -> None:
        rest = b""
        while True:
            try:
                data = os.read(self._descriptor, 4096)
            except OSError:
                data = b""
            *lines, rest = (rest + data).split(b"\n")
            try:
                for line in lines:
                    loop.call_soon_threadsafe(self._lines.put_nowait, line.decode(errors="replace"))
                if not data:
                    loop.call_soon_threadsafe(self._lines.put_nowait, None)
                    return
            except RuntimeError:  # the loop is closed: nobody asks any more
                return
