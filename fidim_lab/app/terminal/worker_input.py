"""Requests of a worker's process, from the pipe that is its standard input; it ends when whoever holds that pipe does.

For workers that compute for seconds between two lines (`tui.foresee`, `model_worker`): reading the next line only when
the last is answered, they would go on computing for a minute after their parent was killed.
"""

import os
import sys
import threading
from collections.abc import Iterator
from queue import SimpleQueue

CHUNK = 1 << 16


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
