"""Handlers that identify from the windows so far, in a process of its own."""

from math import isfinite
from pathlib import Path

from procedures.handlers.apart import apart
from procedures.outcomes import Measurement, Outcome
from procedures.stand import Stand
from procedures.steps import Result
from procedures.steps.accuracy import REACHED, CheckAccuracy
from procedures.steps.excitation import IdentifyBody

DIED = "the process that computes it has ended, or took too long"


async def check_accuracy(stand: Stand, step: CheckAccuracy) -> Result:
    """What is known by now; a fit that fails says so and is no reason to stop anything."""
    windows, s, inertia, problem = await apart(_known, stand.folder.path) or (0, 0.0, 0.0, DIED)
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
    from fidim_lab.identification.accuracy import accuracy_of

    known = accuracy_of(folder)
    return known.windows, known.s, known.inertia, known.problem


async def identify_body(stand: Stand, _step: IdentifyBody) -> Result:
    """The body on the robot, for the next plan; a run goes on where it cannot be identified."""
    values, problem = await apart(_identified, stand.folder.path) or ((), DIED)
    if problem:
        return Result(Outcome.UNSET, f"planning continues with the previous body: {problem}")
    return Result(values=values)


def _identified(folder: Path) -> tuple[tuple[float, ...], str]:
    from fidim_lab.data.campaign import read_campaign
    from fidim_lab.errors import FidimError
    from fidim_lab.identification.excitation.identified import bodies_of

    try:
        found = bodies_of(read_campaign(folder))
    except FidimError as refusal:
        return (), refusal.message
    except (ArithmeticError, ValueError, RuntimeError, OSError) as error:  # LinAlgError is a ValueError
        return (), f"{type(error).__name__}: {error}"
    values = (*map(float, found.likely.vector), *map(float, found.off.ravel()))
    return (values, "") if all(map(isfinite, values)) else ((), "the result is not finite")
