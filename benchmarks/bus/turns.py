"""Imported into a service that is measured: how long each callback of its event loop takes, wall time and CPU time.

A loop that another process keeps from running is late without having done anything: CPU time tells one from the other.
`install` is called by the benchmark's sitecustomize; what was found is written when the process ends.
"""

import asyncio
import asyncio.events
import atexit
import gc
import json
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

LONG = 1e-3
"""s of CPU time: shorter ones are only counted"""


def install(folder: str) -> None:
    """Measure from now on; writes FOLDER/PID.json at the end: [monotonic s, CPU s, wall s, what] of each long one."""
    found: list[tuple[float, float, float, str]] = []
    run = asyncio.events.Handle._run  # noqa: SLF001 - the one place that all callbacks pass

    def measured(handle: Any) -> None:
        wall, cpu = time.monotonic(), time.thread_time()
        run(handle)
        cpu = time.thread_time() - cpu
        if cpu > LONG:
            found.append((wall, cpu, time.monotonic() - wall, _name(handle._callback)))  # noqa: SLF001

    asyncio.events.Handle._run = measured  # type: ignore[method-assign]  # noqa: SLF001
    begun = [0.0, 0.0]

    def collect(phase: str, info: dict[str, int]) -> None:
        if phase == "start":
            begun[:] = time.monotonic(), time.thread_time()
        elif (cpu := time.thread_time() - begun[1]) > LONG:
            found.append((begun[0], cpu, time.monotonic() - begun[0], f"gc, generation {info['generation']}"))

    gc.callbacks.append(collect)
    atexit.register(lambda: Path(folder, f"{os.getpid()}.json").write_text(json.dumps(found), encoding="utf-8"))


def _name(callback: Callable[..., Any]) -> str:
    """Of a task its coroutine, with where it stands afterwards."""
    task = getattr(callback, "__self__", None)
    if isinstance(task, asyncio.Task):
        coroutine = task.get_coro()
        return f"task {getattr(coroutine, '__qualname__', coroutine)}"
    return str(getattr(callback, "__qualname__", callback))
