"""Handler of the jog: recorder and winches at once, then the lag of best correlation."""

import asyncio
import itertools

import numpy as np

from fidim_lab.errors import RefusedError
from procedures.handlers.motion import move_to
from procedures.outcomes import Measurement, Outcome, judge
from procedures.recording.recorder import WindowRecording
from procedures.stand import Stand
from procedures.steps import MoveTo, Result
from procedures.steps.align import PLACES, Jog


async def jog(stand: Stand, step: Jog) -> Result:
    """Go to and fro as long as the recording lasts. Values: lag and its sd (s), correlation."""
    recording = asyncio.ensure_future(stand.recorder.record(step.window, 1, step.duration, stand.progress))
    try:
        for goal in itertools.cycle(step.ends):
            if recording.done():
                break
            await move_to(stand, _move(step, goal))
        recorded = await recording
    finally:
        recording.cancel()
        await asyncio.gather(recording, return_exceptions=True)
    await stand.recorder.put_beside(step.window, PLACES)
    return await _lag(step, recorded)


def _move(step: Jog, goal: tuple[float, ...]) -> MoveTo:
    return MoveTo(
        window=step.window,
        lengths=goal,
        speed=step.speed,
        acceleration=step.acceleration,
        tolerance=step.tolerance,
    )


async def _lag(step: Jog, recorded: WindowRecording) -> Result:
    """In a thread: filters and correlations take some tens of milliseconds."""
    from fidim_lab.model.marker_lag import marker_lag  # scipy: the procedure has imported it

    t = np.arange(len(recorded.lengths)) / recorded.rate

    def look() -> "tuple[float, float, float]":
        found = marker_lag(step.signal, t, recorded.lengths, recorded.markers)
        return found.offset, found.sd, found.correlation

    try:
        lag, sd, correlation = await asyncio.get_running_loop().run_in_executor(None, look)
    except RefusedError as refusal:
        return Result(Outcome.FAIL, refusal.message)
    found = (
        Measurement("uncertainty of the delay", sd, "s", high=step.sd),
        Measurement("correlation of markers and encoders", correlation, "", low=0.9),
    )
    outcome, reason = judge(found)
    says = f"the markers lag the encoders by {1e3 * lag:.2f} ms, ±{1e3 * sd:.2f} ms"
    if not outcome.usable:
        longer = f"--set align.seconds={2.0 * step.duration:g}"
        says = f"{reason}: measure for longer ({longer}), without other programs on this computer"
    return Result(outcome, says, found, values=(lag, sd, correlation))
