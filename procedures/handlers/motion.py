"""Handlers that make winches act: enable, move, hold."""

import asyncio
import math
from collections.abc import Coroutine, Sequence

from drivers.clock import within
from fidim_lab.errors import BusError, DeviceError, FidimError
from fidim_lab.say import each_once
from procedures.outcomes import Outcome
from procedures.stand import Stand
from procedures.steps import Enable, Hold, Lengths, MoveTo, Result, longest_way, travel_time
from procedures.timing import wait_until

EXPECTED_PLACE = 5e-3
"""m: a robot farther from where the plan has it gets its way checked from where it is"""
SLOWEST = 0.01
"""part of speed and acceleration that a cable with next to no way is given: a drive takes no zero"""


async def enable(stand: Stand, step: Enable) -> Result:
    """Configure all winches, see that the robot is where it should be, then power all; wait for the first samples."""
    winches, clock = stand.rig.winches, stand.rig.clock
    await configured(stand, step.timeout)
    stand.progress(0.5)
    if not await wait_until(clock, step.timeout, lambda: stand.rig.markers.latest() is not None):
        raise DeviceError(
            "Motion capture", f"no frame within {step.timeout:g} s", hint="Check that it streams, and the port."
        )
    require_alone(stand)
    _require_place(stand)
    await command_all([winch.enable() for winch in winches])
    return Result(values=stand.lengths())


async def configured(stand: Stand, timeout: float) -> None:
    """Configure all winches, without power, and wait for a sample of each. Raises DeviceError where one has none."""
    winches = stand.rig.winches
    await command_all([winch.configure() for winch in winches])
    if not await wait_until(stand.rig.clock, timeout, lambda: all(winch.latest() for winch in winches)):
        silent = ", ".join(winch.name for winch in winches if winch.latest() is None)
        raise DeviceError(silent, f"no sample within {timeout:g} s of configuring", hint="Check power and bus.")


def require_alone(stand: Stand) -> None:
    """Raise BusError where another master commands the drives, or another node has the id of one."""
    bus = stand.rig.bus
    if bus is not None and bus.strangers:
        raise BusError(
            f"The winches must not be switched on: {bus.strangers}.",
            hint="Stop the other program, or unplug the other node, before anything is switched on.",
        )


def _require_place(stand: Stand) -> None:
    """Raise DeviceError where a robot that an earlier process has left is not where its journal says."""
    if stand.place is None:
        return
    frame, swing = stand.rig.markers.latest(), math.hypot(*stand.robot.limits.free_displacement)
    marker = None if frame is None else frame.main
    wrong = stand.place.wrong(stand.lengths()) or stand.place.marker_wrong(marker, swing)
    if wrong:
        raise DeviceError(
            "The robot is not where it was left",
            f"{wrong}.",
            hint="Was it moved, or an encoder reset? Home it; then resume with --accept-place.",
        )


async def move_to(stand: Stand, step: MoveTo) -> Result:
    """Move all winches so that they start and arrive together, on the straight line that was checked."""
    start = stand.lengths()
    expected = step.start is not None and longest_way(start, step.start) <= EXPECTED_PLACE
    stand.workspace.require(step.start if expected else start, step.lengths, f"Window {step.window}, {step.text}")
    way = longest_way(start, step.lengths)
    if way <= step.tolerance:
        return Result(values=start)
    await _marker_lives(stand)
    await _start(stand, step, start, way)
    clock = stand.rig.clock
    allowed = 1.5 * travel_time(way, step.speed, step.acceleration) + 3.0

    def arrived() -> bool:
        samples = stand.samples()
        lengths = tuple(s.length for s in samples)
        left = longest_way(lengths, step.lengths)
        _require_straight(stand, start, step.lengths, lengths)
        stand.progress(1.0 - min(left / way, 1.0))
        return left <= step.tolerance and all(s.target_reached for s in samples)

    if not await wait_until(clock, allowed, arrived):
        raise _not_arrived(stand, step, allowed)
    return Result(values=stand.lengths())


async def _marker_lives(stand: Stand) -> None:
    """Wait for a new position of a marker that has given none for longer than its guard allows.

    The guard does not count while somebody handles the platform: a marker that was lost or froze then would be found
    out only in motion. It counts now, and ends the run before anything moves.
    """
    clock, allowed = stand.rig.clock, stand.settings.guard.marker_for

    def lives() -> bool:
        return stand.news.at is None or clock.now() - stand.news.at <= allowed

    await wait_until(clock, 2.0 * allowed, lives)


async def _start(stand: Stand, step: MoveTo, start: Lengths, way: float) -> None:
    """Set all winches going together. Raises DeviceError as soon as one of them does not go, for none may go alone."""
    shares = [max(abs(b - a) / way, SLOWEST) for a, b in zip(start, step.lengths, strict=True)]
    profiles = [(step.speed * share, step.acceleration * share) for share in shares]
    winches = stand.rig.winches
    await command_all([winch.prepare(*profile) for winch, profile in zip(winches, profiles, strict=True)])
    moves = [
        asyncio.ensure_future(winch.move_to(length, *profile))
        for winch, length, profile in zip(winches, step.lengths, profiles, strict=True)
    ]
    try:
        await within(stand.rig.clock, stand.settings.motion.together, _until_one_fails(moves))
    except TimeoutError:
        late = [winch.name for winch, move in zip(winches, moves, strict=True) if not move.done()]
        together = stand.settings.motion.together
        raise DeviceError(", ".join(late), f"did not start its move within {together:g} s of the others") from None


async def _until_one_fails(moves: Sequence["asyncio.Future[None]"]) -> None:
    await asyncio.gather(*moves)


def _require_straight(stand: Stand, start: Lengths, end: Lengths, lengths: Lengths) -> None:
    """Raise DeviceError for the winch that is farthest from where it should be by now, if that is too far.

    Where all should be is told by the way that they have gone together.
    """
    ways = [b - a for a, b in zip(start, end, strict=True)]
    gone = [length - a for a, length in zip(start, lengths, strict=True)]
    part = sum(w * g for w, g in zip(ways, gone, strict=True)) / sum(w * w for w in ways)
    off = [g - part * w for w, g in zip(ways, gone, strict=True)]
    worst = max(range(len(off)), key=lambda cable: abs(off[cable]))
    allowed = stand.settings.motion.straight
    if abs(off[worst]) > allowed:
        name, far = stand.rig.winches[worst].name, off[worst] * 1e3
        raise DeviceError(
            name,
            f"is {far:+.1f} mm off the straight line that all winches follow together; {allowed * 1e3:g} mm is allowed",
            hint="Check whether it moves like the others.",
        )


def _not_arrived(stand: Stand, step: MoveTo, allowed: float) -> DeviceError:
    late = [
        (winch.name, f"is at {sample.length:.4f} m, {length:.4f} m was commanded")
        for winch, sample, length in zip(stand.rig.winches, stand.samples(), step.lengths, strict=True)
        if abs(sample.length - length) > step.tolerance or not sample.target_reached
    ]
    name, where = late[0] if late else ("a winch", "has only just arrived")
    return DeviceError(name, f"{where}; the move has taken longer than the allowed {allowed:.1f} s")


async def hold(stand: Stand, _step: Hold) -> Result:
    """Hold all winches, and see that they stand still."""
    settings, clock = stand.settings.hold, stand.rig.clock
    try:
        await within(clock, settings.timeout, command_all([winch.hold() for winch in stand.rig.winches]))
    except TimeoutError:
        raise DeviceError("winches", f"no answer to the hold command within {settings.timeout:g} s") from None
    before = stand.lengths()
    await clock.sleep(settings.still_for)
    moved = longest_way(before, stand.lengths())
    if moved > settings.still:
        reason = f"a winch moved {moved * 1e3:.1f} mm while holding, at most {settings.still * 1e3:g} mm is allowed"
        return Result(Outcome.FAIL, reason)
    return Result(values=stand.lengths())


def _of_device(error: FidimError) -> tuple[str, str]:
    """Which device an error is of, empty where it is of none, and what it says of it."""
    device = error.device if isinstance(error, DeviceError) else ""
    return device, error.message.removeprefix(f"{device}: ").rstrip(".")


async def command_all(commands: Sequence[Coroutine[object, object, None]]) -> None:
    """Give a command to all winches at once.

    Raises DeviceError that names every one that refused, and says once what several give as advice.
    """
    answers = await asyncio.gather(*commands, return_exceptions=True)
    failed: list[FidimError] = []
    for answer in answers:
        if isinstance(answer, FidimError):
            failed.append(answer)
        elif isinstance(answer, BaseException):
            raise answer
    if len(failed) == 1:
        raise failed[0]
    if failed:
        said = "; ".join(f"{of}: {text}" if of else text for text, of in each_once(map(_of_device, failed)).items())
        advice = " ".join(dict.fromkeys(error.hint for error in failed if error.hint))
        raise DeviceError(f"{len(failed)} of {len(answers)} winches", f"{said}.", hint=advice)
