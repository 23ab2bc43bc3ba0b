"""How every run ends, whatever ended it: all winches hold, and are seen to stand still.

`hold_robot` does it and says what it saw; `deferred_interrupts` keeps an impatient second Ctrl-C away from it.
"""

import asyncio
import contextlib
import signal
import threading
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from types import FrameType

from drivers.ports import Clock, DriveState, Winch
from procedures.settings import HoldSettings
from procedures.timing import POLL, within

POWERED = (DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE)
"""states in which a drive keeps the cable by its motor"""

_MAY_HOLD = (DriveState.OPERATION_ENABLED, DriveState.UNKNOWN)


@dataclass(frozen=True)
class Held:
    """Whether the robot is held, and a sentence that says how."""

    ok: bool
    says: str


UNTOUCHED = Held(ok=True, says="Nothing was moved.")


async def hold_robot(
    clock: Clock, winches: Sequence[Winch], settings: HoldSettings, sample_age: float, *, latched: bool
) -> Held:
    """Hold all winches at once and verify. Never raises for what a device does.

    latched: a quick stop was given, which no hold may take back; it is repeated to drives that still run. A winch that
    refuses to hold, or does not answer in time, gets a quick stop too.
    """
    refusals = await asyncio.gather(
        *(_hold(clock, winch, settings.timeout, sample_age, latched=latched) for winch in winches)
    )
    stands = await _stand_still(clock, winches, settings, sample_age)
    says = [f"{w.name} {what}" for w, what in zip(winches, stands, strict=True) if what]
    says += [f"{w.name} was quick-stopped ({why})" for w, why in zip(winches, refusals, strict=True) if why]
    ok = not any(stands)
    sentence = (
        "All winches stand still, held." if ok else "NOT VERIFIED that the robot is held: look before you go near it."
    )
    unpowered = [w.name for w in winches if ok and (s := w.latest()) is not None and s.state not in POWERED]
    if unpowered:
        sentence = f"All winches stand still, without motor power: {', '.join(unpowered)}."
    return Held(ok, " ".join([sentence, *(f"{part}." for part in says)]))


async def _hold(clock: Clock, winch: Winch, timeout: float, sample_age: float, *, latched: bool) -> str:
    """Hold one winch; returns why a quick stop was given instead, empty if it was not."""
    if latched:
        quick_stop(winch)
        return ""
    sample = winch.latest()
    if sample is not None and clock.now() - sample.t <= sample_age and sample.state not in _MAY_HOLD:
        return ""  # stopped already, or without power: a hold would need power
    try:
        await within(clock, timeout, winch.hold())
    except (Exception, asyncio.CancelledError) as error:  # whatever it was, this winch must stop
        quick_stop(winch)
        return str(error) or "no answer to the hold command"
    return ""


def quick_stop(winch: Winch) -> None:
    """A single write; a winch that cannot even be written to must not keep the others from being stopped."""
    with contextlib.suppress(Exception):
        winch.quick_stop()


async def _stand_still(clock: Clock, winches: Sequence[Winch], settings: HoldSettings, sample_age: float) -> list[str]:
    """What keeps each winch from being called still; empty texts when all are."""
    deadline = clock.now() + settings.timeout
    since, places = clock.now(), _lengths(winches)
    while True:
        with contextlib.suppress(asyncio.CancelledError):  # the loop is being closed: go on until it is verified
            await clock.sleep(POLL)
        now = clock.now()
        problems = [
            _problem(winch, place, now, settings, sample_age) for winch, place in zip(winches, places, strict=True)
        ]
        if not any(problems) and _oldest(winches) - since >= settings.still_for:
            return problems
        if now >= deadline:
            return problems
        if any(problems):
            since, places = now, _lengths(winches)


def _oldest(winches: Sequence[Winch]) -> float:
    """Monotonic s up to which every winch has reported: that one stands still is seen only as long as it does."""
    return min((sample.t if (sample := winch.latest()) else float("-inf")) for winch in winches)


def _problem(winch: Winch, place: float | None, now: float, settings: HoldSettings, sample_age: float) -> str:
    sample = winch.latest()
    if sample is None:
        return "has never reported"
    if now - sample.t > sample_age:
        return f"does not answer for {now - sample.t:.2f} s"
    moved = 0.0 if place is None else abs(sample.length - place)
    if moved > settings.still:
        return f"still moves ({moved * 1e3:.1f} mm in {settings.still_for:g} s)"
    return ""


def _lengths(winches: Sequence[Winch]) -> list[float | None]:
    return [None if (sample := winch.latest()) is None else sample.length for winch in winches]


@contextlib.contextmanager
def deferred_interrupts() -> Generator[None]:
    """Let Ctrl-C wait while the robot is being held; it takes some seconds at most. Raised afterwards.

    Works in the main thread, where Python delivers signals; elsewhere there is nothing to defer.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    heard: list[int] = []

    def hear(number: int, _frame: FrameType | None) -> None:
        heard.append(number)

    before = signal.signal(signal.SIGINT, hear)
    try:
        yield
    finally:
        if before is not None:  # None: a handler that was not set from Python
            signal.signal(signal.SIGINT, before)
        if heard:
            signal.raise_signal(signal.SIGINT)
