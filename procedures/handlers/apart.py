"""Computing in a process of its own: guards and bus go on, and a robot need not wait for imports (over a second)."""

import asyncio
import multiprocessing
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import TypeVar

T = TypeVar("T")


async def apart(job: Callable[[Path], T], folder: Path) -> T | None:
    """What a function of a module answers about a run's folder; None where its process has died."""
    pool = ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn"))
    try:
        return await asyncio.get_running_loop().run_in_executor(pool, job, folder)
    except BrokenProcessPool:
        return None
    finally:
        pool.shutdown(wait=False, cancel_futures=True)  # a run that is stopped must not wait for it
