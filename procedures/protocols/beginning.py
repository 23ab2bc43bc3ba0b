"""The start of every procedure with power: enable, check that nothing holds the platform, try each winch.

Also what several procedures share: the wait for rest, the look at a place, the question before there is power.
"""

from collections.abc import Generator

from drivers.ports import Prompt, PromptKind
from fidim_lab.data.records import Plan, PlannedWindow
from fidim_lab.errors import SetupError
from procedures.outcomes import Outcome
from procedures.protocols.displacing import free
from procedures.settings import Settings
from procedures.steps import Ask, AskWithoutPower, Enable, Lengths, Note, Result, Settle, Step, Stop
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


def settling(window: str, settings: Settings, steadied: float = 0.0) -> Settle:
    """The step that waits for rest. steadied: s that somebody needs where it does not come, for the estimate only."""
    motion = settings.motion
    return Settle(
        window=window,
        tolerance=motion.settle_tolerance,
        over=motion.settle_over,
        timeout=motion.settle_timeout,
        steadied=steadied,
    )


def ask_without_power(
    window: str, text: str, settings: Settings, choices: tuple[str, ...] = ("done", "abort")
) -> AskWithoutPower:
    """The question to a person before any drive has power."""
    prompt = Prompt(PromptKind.CONFIRM, text, choices=choices)
    return AskWithoutPower(window=window, prompt=prompt, estimate=settings.estimate(prompt))


def only_place(plan: Plan, done: str, hint: str = "") -> PlannedWindow:
    """The one window of a plan. Raises SetupError where it has more; done: what is done at one place."""
    if len(plan.windows) != 1:
        raise SetupError(f"Plan {plan.name!r} has {len(plan.windows)} windows; {done} at one place.", hint=hint)
    return plan.windows[0]


def compared(window: str, rest: tuple[float, ...], settings: Settings) -> Generator[Step, Result, None]:
    """The look at one place, where the marker rested; what is wrong there ends the run."""
    result = yield ComparePlace(window=window, marker=rest, off=settings.place.off)
    if not result.outcome.usable:
        where = f"Window {window}" if window else "Here"
        yield Stop(window=window, outcome=Outcome.FAIL, reason=f"{where}: {result.reason}.")
