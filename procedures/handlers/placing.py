"""Handlers that compare lengths with markers."""

from collections.abc import AsyncIterator
from dataclasses import dataclass, replace

import numpy as np

from fidim_lab.arrays import PerCable, Vector3
from fidim_lab.errors import InfeasibleError
from procedures.expected.nominal_rest import NominalRest
from procedures.expected.place_check import (
    Response,
    SeenAtRest,
    common_factor,
    place_measurements,
    response_cause,
    response_measurements,
)
from procedures.handlers.motion import move_to
from procedures.handlers.trace import MarkerTrace
from procedures.outcomes import Measurement, Outcome, judge
from procedures.stand import Stand
from procedures.steps import Lengths, MoveTo, Result
from procedures.steps.placing import SWINGS, ComparePlace, TryWinches
from procedures.timing import POLL, wait_until

FEWEST = 10
"""frames with the marker, for a mean"""
ARRIVED = 0.25
"""of the way that may be left; what the encoders say then is what counts"""
PERIODS = 2.0
"""of the slowest swing, that a look takes at least: a mean with a Hann window leaves nothing of it then"""
SLOWEST = 0.1
"""Hz: what is slower (a freedom without restoring force) drifts, and no look is long enough for it"""
ROOM = 2.0
"""times the way that must be within the limits to both sides: a winch may turn the wrong way, or twice as far"""


@dataclass(frozen=True, eq=False)
class _Look:
    """Means over a while, weighted so that a swing leaves little in them."""

    lengths: Lengths
    marker: Vector3
    tensions: PerCable


async def compare_place(stand: Stand, step: ComparePlace) -> Result:
    """Look up where the marker should be at the lengths of now."""
    if stand.rest is None:
        return Result(reason="no model to compare with")
    return _placed(stand, stand.rest, SeenAtRest(stand.lengths(), np.array(step.marker)))


def _placed(stand: Stand, rest: NominalRest, seen: SeenAtRest) -> Result:
    try:
        found, cause = place_measurements(rest, seen, stand.places, stand.settings.place)
    except InfeasibleError as refusal:
        says = f"the platform cannot rest at the lengths that the encoders report: {refusal.message.rstrip('.')}"
        return Result(Outcome.FAIL, says)
    outcome, reason = judge(found)
    return Result(outcome, "; ".join(filter(None, (reason, cause))), found)


async def try_winches(stand: Stand, step: TryWinches) -> Result:
    """Compare the place, then move one winch after another and look; the first wrong answer ends it."""
    rest = stand.rest
    if rest is None:
        return Result(reason="no model to compare with", values=stand.lengths())
    if not await _rests(stand, step):
        return Result(Outcome.FAIL, "the platform does not come to rest", answer=SWINGS)
    over = _looking(rest, stand.lengths(), step.over)
    start = await _look(stand, over)
    if start is None:
        return Result(Outcome.FAIL, "the main marker was seen too rarely to compare it with the lengths")
    placed = _placed(stand, rest, SeenAtRest(start.lengths, start.marker))
    if not placed.outcome.usable:
        return placed
    found, responses, untried = list(placed.measurements), list[Response](), list[str]()
    async for cable, look in _moves(stand, replace(step, over=over), start.lengths, untried):
        if look is None:
            return Result(Outcome.FAIL, f"the main marker was lost while winch {cable} was tested", tuple(found))
        one = _response(rest, cable, start, look)
        responses.append(one)
        found += response_measurements(one, stand.settings.place)
        outcome, reason = judge(found)
        if not outcome.usable:
            cause = response_cause(one, rest, start.lengths, look.lengths[cable - 1] - start.lengths[cable - 1])
            return Result(outcome, f"winch {cable}: {cause} ({reason})", tuple(found))
    return _verdict(stand, found, responses, untried)


def _looking(rest: NominalRest, lengths: Lengths, least: float) -> float:
    """s of each look: a slow robot's swing must not pass for an answer."""
    try:
        swings = [one for one in rest.frequencies(lengths) if one > SLOWEST]
    except InfeasibleError:
        return least  # that is found and said by the comparison of places
    return max(least, PERIODS / min(swings)) if swings else least


def _verdict(stand: Stand, found: list[Measurement], responses: list[Response], untried: list[str]) -> Result:
    if responses:
        found.append(common_factor(responses, stand.settings.place))
    outcome, reason = judge(found)
    if not outcome.usable:
        reason = f"{reason}: are the sizes of drums or gears in the rig file wrong"
    if untried:
        reason = "; ".join(filter(None, (reason, *untried)))
        outcome = Outcome.MARGINAL if outcome is Outcome.PASS else outcome
    return Result(outcome, reason, tuple(found), values=stand.lengths())


async def _moves(
    stand: Stand, step: TryWinches, start: Lengths, untried: list[str]
) -> AsyncIterator[tuple[int, _Look | None]]:
    """Each winch in its turn, with what was seen then; at the end all are back."""
    for cable in range(1, step.winches + 1):
        ways = (step.way, 0.5 * step.way)
        way = next((one for one in ways if _has_room(stand, start, cable, ROOM * one)), None)
        if way is None:
            untried.append(f"winch {cable} was not tested: too close to a limit of lengths or tensions")
            continue
        await move_to(stand, _move(step, _aside(start, cable, way)))
        yield cable, await _look(stand, step.over)
        stand.progress(cable / (step.winches + 1))
    await move_to(stand, _move(step, start))


def _has_room(stand: Stand, start: Lengths, cable: int, way: float) -> bool:
    return all(stand.workspace.at(_aside(start, cable, side * way)) is None for side in (-1, 1))


def _aside(start: Lengths, cable: int, way: float) -> Lengths:
    return tuple(length + way * (number == cable) for number, length in enumerate(start, start=1))


def _move(step: TryWinches, goal: Lengths) -> MoveTo:
    return MoveTo(lengths=goal, speed=step.speed, acceleration=step.acceleration, tolerance=ARRIVED * step.way)


def _response(rest: NominalRest, cable: int, start: _Look, look: _Look) -> Response:
    before, after = rest.at(start.lengths), rest.at(look.lengths)
    return Response(
        cable,
        look.marker - start.marker,
        after.marker - before.marker,
        float(look.tensions[cable - 1] - start.tensions[cable - 1]),
        float(after.tensions[cable - 1] - before.tensions[cable - 1]),
    )


async def _rests(stand: Stand, step: TryWinches) -> bool:
    """Whether the marker comes to rest in time."""
    motion, source, clock = stand.settings.motion, stand.rig.markers, stand.rig.clock
    trace = MarkerTrace(source.rate, motion.settle_over)

    def still() -> bool:
        trace.take(source.latest(), clock.now())
        return trace.full and trace.spread <= motion.settle_tolerance

    return await wait_until(clock, step.timeout, still)


async def _look(stand: Stand, over: float) -> _Look | None:
    """Lengths, marker and tensions over some seconds; None where the marker was seen too seldom."""
    clock, source = stand.rig.clock, stand.rig.markers
    begin, number = clock.now(), -1
    winches, markers = list[tuple[float, Lengths, Lengths]](), list[tuple[float, tuple[float, float, float]]]()
    while (passed := clock.now() - begin) < over:
        winches.append((passed, stand.lengths(), stand.tensions()))
        frame = source.latest()
        if frame is not None and frame.number != number:
            number = frame.number
            if frame.main is not None:
                markers.append((passed, frame.main))
        await clock.sleep(POLL)
    if not markers:
        return None
    times, places = [t for t, _ in markers], np.array([place for _, place in markers])
    whole = np.linalg.norm(places - np.median(places, axis=0), axis=1) <= stand.settings.record.jump  # no damaged frame
    if whole.sum() < FEWEST:
        return None
    return _Look(
        tuple(float(value) for value in np.mean([lengths for _, lengths, _ in winches], axis=0)),
        _smooth(np.array(times)[whole].tolist(), places[whole], over),
        _smooth([t for t, _, _ in winches], np.array([tensions for _, _, tensions in winches]), over),
    )


def _smooth(times: list[float], values: np.ndarray, over: float) -> np.ndarray:
    """Mean with a Hann window: of a swing of one period and a half it leaves an eighth, of two periods nothing."""
    weights = np.sin(np.pi * np.array(times) / over) ** 2
    return weights @ values / weights.sum()
