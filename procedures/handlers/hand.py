"""Handlers of steps for the person at the robot: asking, and waiting until the platform is free."""

from collections import deque

import numpy as np

from fidim_lab.errors import DeviceError
from procedures.handlers.trace import MarkerTrace
from procedures.outcomes import Measurement, Outcome, judge
from procedures.stand import Stand
from procedures.steps import Ask, AwaitHandsOff, Result
from procedures.timing import POLL

LOOKS = 5

_OUTCOMES = {"skip": Outcome.SKIPPED, "abort": Outcome.ABORTED}


async def ask(stand: Stand, step: Ask) -> Result:
    """Put the question and wait for one of its choices."""
    stand.prompted(step.window, step.prompt)
    answer = await stand.rig.operator.answer(step.prompt)
    if answer not in step.prompt.choices:
        allowed = ", ".join(step.prompt.choices)
        raise DeviceError("operator", f"answered {answer!r} to “{step.prompt.text}”; allowed are {allowed}")
    return Result(_OUTCOMES.get(answer, Outcome.PASS), answer=answer)


async def await_hands_off(stand: Stand, step: AwaitHandsOff) -> Result:
    """Wait until the marker moves and all tensions have margin, both for `over` seconds."""
    clock, source = stand.rig.clock, stand.rig.markers
    trace = MarkerTrace(source.rate, step.over)
    tensions: deque[tuple[float, ...]] = deque(maxlen=max(1, round(step.over / POLL)))
    begin = clock.now()
    while True:
        passed = clock.now() - begin
        trace.take(source.latest(), clock.now())
        tensions.append(stand.tensions())
        found = _measurements(step, trace, np.array(tensions))
        outcome, reason = judge(found)
        if outcome.usable:
            return Result(measurements=found)
        if passed >= step.timeout:
            if not trace.full:
                lost = "almost no new position of the main marker arrived (lost, frozen, or no stream)"
                reason = "; ".join([lost, *(m.sentence for m in found[1:] if not m.outcome.usable)])
            return Result(Outcome.FAIL, f"not moving freely after {step.timeout:g} s: {reason}", found)
        stand.progress(passed / step.timeout)
        await clock.sleep(POLL)


def _smoothed(tensions: np.ndarray) -> np.ndarray:
    """The mean of each LOOKS in a row, (N, n): a current sensor's noise is not the cable going slack."""
    looks = min(LOOKS, len(tensions))
    sums = np.cumsum(np.vstack([np.zeros(tensions.shape[1]), tensions]), axis=0)
    return (sums[looks:] - sums[:-looks]) / looks


def _measurements(step: AwaitHandsOff, trace: MarkerTrace, tensions: np.ndarray) -> tuple[Measurement, ...]:
    low, high = step.limits
    smooth = _smoothed(tensions)
    slack, tight = int(np.argmin(smooth.min(axis=0))), int(np.argmax(smooth.max(axis=0)))
    return (
        Measurement("marker peak to peak", trace.spread if trace.full else None, "m", low=step.moving),
        Measurement(f"smallest tension, cable {slack + 1}", float(smooth[:, slack].min()), "N", low=low),
        Measurement(f"largest tension, cable {tight + 1}", float(smooth[:, tight].max()), "N", high=high),
    )
