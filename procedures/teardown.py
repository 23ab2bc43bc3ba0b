"""The end of every run, whatever ended it: all winches stop, and each encoder shows that its winch stands.

`hold_robot` does it and says what it saw, winch by winch; one that does not obey is stopped by stronger means.
`deferred_interrupts` keeps an impatient second Ctrl-C away from it.
"""

import asyncio
import contextlib
import signal
import threading
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from types import FrameType

from drivers.clock import within
from drivers.ports import Clock, DriveState, Winch
from fidim_lab.errors import DeviceError, FidimError
from fidim_lab.say import each_once
from procedures.settings import GuardSettings, HoldSettings
from procedures.stopping import POWERED, StoppedWinch, Stopping, quick_stop
from procedures.timing import POLL

_MAY_HOLD = (DriveState.OPERATION_ENABLED, DriveState.UNKNOWN)


@dataclass(frozen=True)
class Held:
    """Whether the robot is held, a sentence that says how, and what each encoder told."""

    ok: bool
    says: str
    winches: tuple[StoppedWinch, ...] = ()

    def doubted(self, why: str) -> "Held":
        """The same where encoders were contradicted (why: by what): then none proves that a winch stands."""
        says = (
            f"NOT VERIFIED that the robot is held: {why}, so cut the power by hand before you go near it. "
            f"By the encoders: {self.says}"
        )
        return Held(ok=False, says=says, winches=self.winches)


UNTOUCHED = Held(ok=True, says="This run moved nothing.")


async def hold_robot(
    clock: Clock,
    winches: Sequence[Winch],
    settings: HoldSettings,
    guard: GuardSettings,
    *,
    latched: bool,
    doubt: str = "",
) -> Held:
    """Stop all winches at once and prove it. Never raises for what a device does.

    latched: a quick stop was given, which no hold may take back; it is repeated to drives that still run. A winch that
    refuses to hold, or does not answer in time, gets a quick stop too. One that does not obey that, or is not seen to,
    is stopped by NMT; then host's heartbeat and SYNC are withheld from all, so that each drive's own watchdog acts.
    What an encoder shows that was contradicted proves nothing. doubt: what contradicts all of them, in words.
    """
    stops = [Stopping(winch, clock.now(), settings, guard, quick_stopped=latched) for winch in winches]
    holds = [
        asyncio.ensure_future(_hold(clock, stop, settings.timeout, guard.sample_age, latched=latched)) for stop in stops
    ]
    deadline = clock.now() + settings.timeout
    while not all(hold.done() for hold in holds) or not all(stop.stands for stop in stops):
        with contextlib.suppress(asyncio.CancelledError):  # the loop is being closed: go on until it is verified
            await clock.sleep(POLL)
        now = clock.now()
        final = now >= deadline and not any(stop.waited_for(now) for stop in stops)
        for stop, hold in zip(stops, holds, strict=True):
            if not stop.look(now, final=final):
                continue
            hold.cancel()
            stop.escalate(now, final=final)
        if final or any(stop.forced for stop in stops):
            break
    refusals = await asyncio.gather(*holds)
    if any(stop.forced for stop in stops):
        await _by_watchdog(clock, stops, settings)
    held = _held(winches, [stop.told() for stop in stops], refusals)
    blind = [winch.name for winch in winches if (sample := winch.latest()) is not None and sample.blind]
    doubt = doubt or (
        f"the encoders of {' and '.join(blind)} are contradicted by their drives"
        if len(blind) > 1
        else f"the encoder of {blind[0]} is contradicted by its drive"
        if blind
        else ""
    )
    return held.doubted(doubt) if doubt else held


async def _by_watchdog(clock: Clock, stops: Sequence[Stopping], settings: HoldSettings) -> None:
    """Give no sign of life until each drive's own watchdog has stopped it, then ask every encoder twice."""
    seconds = max(stop.winch.fall_silent() for stop in stops)
    await clock.sleep(seconds)
    before = await asyncio.gather(*(_ask(clock, stop.winch, settings.timeout) for stop in stops))
    await clock.sleep(settings.still_for)
    after = await asyncio.gather(*(_ask(clock, stop.winch, settings.timeout) for stop in stops))
    for stop, first, last in zip(stops, before, after, strict=True):
        stop.asked(clock.now(), first, last)


async def _ask(clock: Clock, winch: Winch, timeout: float) -> float | None:
    with contextlib.suppress(FidimError, TimeoutError):
        return await within(clock, timeout, winch.ask_length())
    return None


def _held(winches: Sequence[Winch], stopped: Sequence[StoppedWinch], refusals: Sequence[str]) -> Held:
    """The final sentence: only what was measured."""
    ok = all(one.stands and one.obeyed for one in stopped)
    unsure = [one.name for one in stopped if not one.stands]
    disobeyed = [one.name for one in stopped if not one.obeyed]
    states = {w.name: s.state for w in winches if ok and (s := w.latest()) is not None}
    unknown = [name for name, state in states.items() if state is DriveState.UNKNOWN]
    unpowered = [name for name, state in states.items() if state not in (*POWERED, DriveState.UNKNOWN)]
    if unsure:
        sentence = "NOT VERIFIED that the robot is held: "
        sentence += "cut the power by hand before" if disobeyed else "look before"
        sentence += " you go near it."
    elif disobeyed:
        sentence = "All winches stand still by now, but cut the power by hand before you go near the robot."
    elif unpowered:
        sentence = f"All winches stand still, without motor power: {', '.join(unpowered)}."
    elif unknown:
        sentence = f"All winches stand still; whether they have motor power is not known: {', '.join(unknown)}."
    else:
        sentence = "All winches stand still, held."
    told = [(one.name, one.says.removeprefix(f"{one.name} ")) for one in stopped if one.says]
    told += [
        (w.name, f"was quick-stopped ({why.rstrip('.')})") for w, why in zip(winches, refusals, strict=True) if why
    ]
    says = [f"{of}{', each:' if ', ' in of else ''} {text}" for text, of in each_once(told).items()]
    if not ok and (stand := [one.name for one in stopped if one.stands and one.obeyed]):
        says.append(f"{', '.join(stand)} {'stands' if len(stand) == 1 else 'stand'} still")
    return Held(ok, " ".join([sentence, *(f"{part}." for part in says)]), tuple(stopped))


async def _hold(clock: Clock, stop: Stopping, timeout: float, sample_age: float, *, latched: bool) -> str:
    """Hold one winch; returns why a quick stop was given instead, empty if it was not."""
    winch = stop.winch
    if latched:
        quick_stop(winch)
        return ""
    sample = winch.latest()
    if sample is not None and clock.now() - sample.t <= sample_age and sample.state not in _MAY_HOLD:
        return ""  # stopped already, or without power: a hold would need power
    try:
        await within(clock, timeout, winch.hold())
    except (Exception, asyncio.CancelledError) as error:  # whatever it was, this winch must stop
        stop.quick_stop(clock.now())
        said = str(error).removeprefix(f"{error.device}: ") if isinstance(error, DeviceError) else str(error)
        return said or "no answer to the hold command"
    return ""


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
