"""The start of every procedure with power: enable, check that nothing holds the platform, try each winch."""

from collections.abc import Generator

from drivers.ports import Prompt, PromptKind
from procedures.outcomes import Outcome
from procedures.protocols.displacing import free
from procedures.settings import Settings
from procedures.steps import Ask, Enable, Lengths, Note, Result, Step, Stop
from procedures.steps.placing import SWINGS, ComparePlace, TryWinches

REST = "The platform still swings. Bring it to rest: first each winch is tested by moving it a few millimetres."


def begin(n: int, settings: Settings, *, attended: bool = True) -> Generator[Step, Result, Lengths]:
    """Returns where the winches stand (empty in a list of what will be done). n: how many winches.

    attended: somebody can bring a swinging platform to rest; else the winches are not tried then, and only the places
    that follow are compared.
    """
    at = (yield Enable()).values
    yield from free(settings)
    place, motion = settings.place, settings.motion
    step = TryWinches(
        winches=n,
        way=place.way,
        speed=min(place.speed, motion.speed),
        acceleration=min(place.acceleration, motion.acceleration),
        over=place.over,
        timeout=motion.settle_timeout,
    )
    result = yield step
    for _ in range(motion.settle_tries - 1 if attended else 0):
        if result.answer != SWINGS:
            break
        prompt = Prompt(PromptKind.STEADY, REST, choices=("done", "abort"))
        if (yield Ask(prompt=prompt, estimate=settings.estimate(prompt))).answer == "abort":
            yield Stop(outcome=Outcome.ABORTED, reason="The operator aborted before the winches were tested.")
        result = yield step
    if result.answer == SWINGS and not attended:
        yield Note(remark=f"the winches were not tested: {result.reason}")
    elif not result.outcome.usable:
        yield Stop(outcome=Outcome.FAIL, reason=f"In the test of the winches: {result.reason}.")
    return result.values or at


def compared(window: str, rest: tuple[float, ...], settings: Settings) -> Generator[Step, Result, None]:
    """The look at one place, where the marker rested; what is wrong there ends the run."""
    result = yield ComparePlace(window=window, marker=rest, off=settings.place.off)
    if not result.outcome.usable:
        where = f"Window {window}" if window else "Here"
        yield Stop(window=window, outcome=Outcome.FAIL, reason=f"{where}: {result.reason}.")
