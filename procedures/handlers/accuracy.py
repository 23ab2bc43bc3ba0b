"""Handler that identifies from the windows so far, in a process of its own: guards and bus go on meanwhile."""

import asyncio
import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

from procedures.outcomes import Measurement, Outcome
from procedures.stand import Stand
from procedures.steps import Result
from procedures.steps.accuracy import REACHED, CheckAccuracy


async def check_accuracy(stand: Stand, step: CheckAccuracy) -> Result:
    """What is known by now; a fit that fails says so and is no reason to stop anything."""
    pool = ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn"))
    try:
        known = await asyncio.get_running_loop().run_in_executor(pool, _known, stand.folder.path)
    except BrokenProcessPool:
        return Result(Outcome.UNSET, "the accuracy is not known: the process that computes it has died")
    finally:
        pool.shutdown(wait=False, cancel_futures=True)  # a run that is stopped must not wait for it
    windows, s, inertia, problem = known
    if problem:
        return Result(Outcome.UNSET, f"the accuracy is not known yet: {problem}")
    wanted = step.accuracy
    found = (
        Measurement("largest sd of the centre of mass", s, "m", high=wanted.s),
        Measurement("largest sd of the inertia", inertia, "m²", high=wanted.inertia),
    )
    says = f"after {windows} windows s is known within {s:.2g} m, I within {inertia:.2g} m²"
    reached = s <= wanted.s and inertia <= wanted.inertia
    return Result(reason=says, measurements=found, answer=REACHED if reached else "")


def _known(folder: Path) -> tuple[int, float, float, str]:
    """In the other process, which alone imports what identifies (over a second that a robot would wait at a resume)."""
    from fidim_lab.identification.accuracy import accuracy_of

    known = accuracy_of(folder)
    return known.windows, known.s, known.inertia, known.problem
