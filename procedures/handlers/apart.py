"""Computing in a process of its own, so that guards and bus need not wait for imports (over a second)."""

import asyncio
import multiprocessing
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import TypeVar

T = TypeVar("T")


LONGEST = 60.0
"""s: nobody who says abort waits longer"""


async def apart(job: Callable[[Path], T], folder: Path, longest: float = LONGEST) -> T | None:
    """The answer of a module's function about a run folder; None where its process died or exceeded the time (s)."""
    pool = ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn"))
    try:
        return await asyncio.wait_for(asyncio.get_running_loop().run_in_executor(pool, job, folder), longest)
    except (BrokenProcessPool, TimeoutError):
        return None
    finally:
        pool.shutdown(wait=False, cancel_futures=True)  # a run that is stopped must not wait for it
