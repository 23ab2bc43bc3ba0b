"""Handlers that record, judge, accept and reject windows, and those that only print something."""

import asyncio

import numpy as np

from fidim_lab.errors import FidimError
from procedures.expected.nominal_rest import NominalRest
from procedures.outcomes import Measurement, Outcome, judge
from procedures.recording.marker_place import BESIDE, place_measurements
from procedures.recording.recorder import WindowRecording
from procedures.recording.window_check import JUMP, SMALLEST, window_measurements
from procedures.settings import PlaceSettings
from procedures.stand import Stand
from procedures.steps import SLIPPED, Accept, CheckWindow, GiveUp, Lengths, Note, Record, Reject, Result

SINCE_REST = (
    "since the platform was at rest, a cable slipped on its drum, or the marker or motion capture's origin moved"
)


async def record(stand: Stand, step: Record) -> Result:
    """Record; what was recorded stays with the recorder until it is accepted or rejected."""
    recording = await stand.recorder.record(step.window, step.attempt, step.duration, stand.progress)
    lost = {name: count for name, count in recording.counters.items() if count and name != "received"}
    return Result(reason="; ".join(f"{count} frames {name}" for name, count in sorted(lost.items())))


async def check_window(stand: Stand, step: CheckWindow) -> Result:
    """Judge the recording just made. In a thread: it takes some milliseconds, a period of SYNC."""
    recording = stand.recorder.last(step.window, step.attempt)
    rest, lengths = stand.rest, stand.lengths()

    def look() -> tuple[Measurement, ...]:
        what = (recording, step.limits, step.lengths, step.equilibrium, stand.newton_per_ampere)
        where = () if rest is None else _place(recording, step, rest, lengths, stand.settings.place)
        return (*window_measurements(*what), *where)

    found = await asyncio.get_running_loop().run_in_executor(None, look)
    outcome, reason = judge(found)
    failed = [one.name for one in found if one.outcome is Outcome.FAIL]
    # a slack cable lets a marker be anywhere, and one that jumps is not where it is seen: the next attempt tells
    elsewhere = any(name.startswith((SMALLEST, JUMP)) for name in failed)
    if BESIDE in failed and not elsewhere:
        return Result(outcome, f"{reason}: {SINCE_REST}", found, answer=SLIPPED)
    return Result(outcome, reason, found)


def _place(
    recording: WindowRecording, step: CheckWindow, rest: NominalRest, lengths: Lengths, settings: PlaceSettings
) -> tuple[Measurement, ...]:
    """Nothing where the model does not know how the platform would swing here."""
    from procedures.recording.marker_drift import drift_measurement  # scipy: `run_procedure` has imported it

    place = recording.markers[:, 0, :]
    t = np.arange(len(place)) / recording.rate
    try:
        drift = drift_measurement(t, place, rest.frequencies(lengths), step.limits.drift)
        if not step.equilibrium:
            return (drift,)
        return (drift, *place_measurements(rest, lengths, place, recording.rate, np.array(step.equilibrium), settings))
    except FidimError:  # lengths at which it could not rest are told by others
        return ()


async def accept(stand: Stand, step: Accept) -> Result:
    """Make it a part of the campaign."""
    await stand.recorder.accept(step.window)
    await stand.disk.do(lambda: stand.folder.add(step.window, step.role, step.equilibrium))
    stand.places.windows.append(step.window)
    return Result(step.outcome, step.reason)


async def reject(stand: Stand, step: Reject) -> Result:
    """Set it aside."""
    await stand.recorder.reject(step.window, step.attempt)
    return Result(Outcome.FAIL, step.reason)


async def give_up(_stand: Stand, step: GiveUp) -> Result:
    """Nothing to do but say so."""
    return Result(step.outcome, step.reason)


async def note(_stand: Stand, _step: Note) -> Result:
    """Nothing to do but say so."""
    return Result()
