"""Handlers of the release device: take hold, wait until it holds the platform still, let go."""

import math

from drivers.ports import Release, ReleaseState
from fidim_lab.errors import SetupError
from procedures.handlers.trace import MarkerTrace
from procedures.outcomes import Measurement, Outcome, judge
from procedures.stand import Stand
from procedures.steps import AwaitHeld, LetGo, Result, TakeHold
from procedures.timing import POLL


async def take_hold(stand: Stand, _step: TakeHold) -> Result:
    """Switch it on, confirmed."""
    await _release(stand).hold()
    return Result()


async def let_go(stand: Stand, _step: LetGo) -> Result:
    """Switch it off, confirmed. The recording that follows begins when the platform is seen to move."""
    await _release(stand).release()
    return Result()


async def await_held(stand: Stand, step: AwaitHeld) -> Result:
    """Look until it is held, still and aside, or the time is up."""
    clock, source, release = stand.rig.clock, stand.rig.markers, _release(stand)
    trace = MarkerTrace(source.rate, step.over)
    begin = clock.now()
    while True:
        passed = clock.now() - begin
        trace.take(source.latest(), clock.now())
        if release.state is not ReleaseState.HOLDS:
            return Result(Outcome.FAIL, f"the release does not hold the platform: it says “{release.state}”")
        found = _measurements(step, trace)
        outcome, reason = judge(found)
        if outcome.usable:
            return Result(measurements=found, values=tuple(float(v) for v in trace.mean))
        if passed >= step.timeout:
            return Result(Outcome.FAIL, f"not held still away from rest after {step.timeout:g} s: {reason}", found)
        stand.progress(passed / step.timeout)
        await clock.sleep(POLL)


def _measurements(step: AwaitHeld, trace: MarkerTrace) -> tuple[Measurement, ...]:
    full = trace.full
    aside = [float(trace.mean[axis] - step.equilibrium[axis]) for axis in range(2)] if full else None
    return (
        Measurement("marker peak to peak", trace.spread if full else None, "m", high=step.still),
        Measurement("displacement", None if aside is None else math.hypot(*aside), "m", low=step.least),
        *(
            Measurement(f"displacement {name}", None if aside is None else abs(aside[axis]), "m", high=high)
            for axis, (name, high) in enumerate(zip("xy", step.displacement, strict=True))
        ),
    )


def _release(stand: Stand) -> Release:
    release = stand.rig.release
    if release is None:
        raise SetupError("The procedure uses a release device, but the rig has none.", hint="Add [release] to it.")
    return release
