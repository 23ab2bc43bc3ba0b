"""Handlers that make winches act: enable, move, hold."""

import asyncio
from collections.abc import Coroutine, Sequence

from fidim_lab.errors import DeviceError, FidimError
from procedures.outcomes import Outcome
from procedures.stand import Stand
from procedures.steps import Enable, Hold, Lengths, MoveTo, Result, longest_way, travel_time
from procedures.timing import wait_until, within

EXPECTED_PLACE = 5e-3
"""m: a robot farther from where the plan has it gets its way checked from where it is"""
SLOWEST = 0.01
"""part of speed and acceleration that a cable with next to no way is given: a drive takes no zero"""


async def enable(stand: Stand, step: Enable) -> Result:
    """Configure all winches, then power all; wait for the first samples of winches and markers."""
    winches = stand.rig.winches
    await _all([winch.configure() for winch in winches])
    stand.progress(0.5)
    await _all([winch.enable() for winch in winches])
    clock = stand.rig.clock
    if not await wait_until(clock, step.timeout, lambda: all(winch.latest() is not None for winch in winches)):
        silent = [winch.name for winch in winches if winch.latest() is None]
        raise DeviceError(
            ", ".join(silent), f"no sample within {step.timeout:g} s of enabling", hint="Check power and bus."
        )
    if not await wait_until(clock, step.timeout, lambda: stand.rig.markers.latest() is not None):
        raise DeviceError(
            "Motion capture", f"no frame within {step.timeout:g} s", hint="Check that it streams, and the port."
        )
    return Result(values=stand.lengths())


async def move_to(stand: Stand, step: MoveTo) -> Result:
    """Move all winches so that they start and arrive together, on the straight line that was checked."""
    start = stand.lengths()
    expected = step.start is not None and longest_way(start, step.start) <= EXPECTED_PLACE
    stand.workspace.require(step.start if expected else start, step.lengths, f"Window {step.window}, {step.text}")
    way = longest_way(start, step.lengths)
    if way <= step.tolerance:
        return Result(values=start)
    await _all(_moves(stand, step, start, way))
    clock = stand.rig.clock
    allowed = 1.5 * travel_time(way, step.speed, step.acceleration) + 3.0

    def arrived() -> bool:
        samples = stand.samples()
        left = longest_way(tuple(s.length for s in samples), step.lengths)
        stand.progress(1.0 - min(left / way, 1.0))
        return left <= step.tolerance and all(s.target_reached for s in samples)

    if not await wait_until(clock, allowed, arrived):
        raise _not_arrived(stand, step, allowed)
    return Result(values=stand.lengths())


def _moves(stand: Stand, step: MoveTo, start: Lengths, way: float) -> list[Coroutine[object, object, None]]:
    shares = [max(abs(b - a) / way, SLOWEST) for a, b in zip(start, step.lengths, strict=True)]
    return [
        winch.move_to(length, step.speed * share, step.acceleration * share)
        for winch, length, share in zip(stand.rig.winches, step.lengths, shares, strict=True)
    ]


def _not_arrived(stand: Stand, step: MoveTo, allowed: float) -> DeviceError:
    late = [
        (winch.name, f"is at {sample.length:.4f} m, {length:.4f} m was asked for")
        for winch, sample, length in zip(stand.rig.winches, stand.samples(), step.lengths, strict=True)
        if abs(sample.length - length) > step.tolerance or not sample.target_reached
    ]
    name, where = late[0] if late else ("a winch", "has only just arrived")
    return DeviceError(name, f"{where}; the move has taken longer than the allowed {allowed:.1f} s")


async def hold(stand: Stand, _step: Hold) -> Result:
    """Hold all winches, and see that they stand still."""
    settings, clock = stand.settings.hold, stand.rig.clock
    try:
        await within(clock, settings.timeout, _all([winch.hold() for winch in stand.rig.winches]))
    except TimeoutError:
        raise DeviceError("winches", f"no answer to the hold command within {settings.timeout:g} s") from None
    before = stand.lengths()
    await clock.sleep(settings.still_for)
    moved = longest_way(before, stand.lengths())
    if moved > settings.still:
        reason = f"a winch moved {moved * 1e3:.1f} mm while holding, at most {settings.still * 1e3:g} mm is allowed"
        return Result(Outcome.FAIL, reason)
    return Result(values=stand.lengths())


async def _all(commands: Sequence[Coroutine[object, object, None]]) -> None:
    """Give a command to all winches at once. Raises DeviceError that names every one that refused."""
    answers = await asyncio.gather(*commands, return_exceptions=True)
    failed = [answer for answer in answers if isinstance(answer, BaseException)]
    for error in failed:
        if not isinstance(error, FidimError):
            raise error
    if len(failed) == 1:
        raise failed[0]
    if failed:
        said = "; ".join(str(error) for error in failed)
        raise DeviceError(f"{len(failed)} of {len(answers)} winches", said)
