"""Handlers of homing: configure without power, measure the pose, take the counts."""

import asyncio

import numpy as np

from drivers.clock import within
from fidim_lab.data.rigid_body import fit_pose
from fidim_lab.errors import DeviceError
from fidim_lab.model.mechanism import Mechanism
from procedures.handlers.motion import command_all, configured, require_alone
from procedures.outcomes import Measurement, Outcome, judge
from procedures.stand import Stand
from procedures.steps import Configure, MeasurePose, Result, SetLengths
from procedures.timing import POLL

FRAMES = 10
"""with all markers, at least"""


async def configure(stand: Stand, step: Configure) -> Result:
    """Configure all, and wait for samples. Values: lengths by the zeros so far, m."""
    await configured(stand, step.timeout)
    require_alone(stand)
    return Result(values=stand.lengths())


async def measure_pose(stand: Stand, step: MeasurePose) -> Result:
    """The pose by all markers, averaged while they stand still. Values: cable lengths, m."""
    frames: list[tuple[tuple[float, float, float], ...]] = []

    async def watch() -> None:
        async for frame in stand.rig.markers.frames():
            if len(places := [place for place in frame.positions if place is not None]) == len(stand.robot.markers):
                frames.append(tuple(places))

    watching = asyncio.ensure_future(watch())
    try:
        await stand.rig.clock.sleep(step.over)
    finally:
        watching.cancel()
        await asyncio.gather(watching, return_exceptions=True)
    if len(frames) < FRAMES:
        reason = f"only {len(frames)} frames with all {len(stand.robot.markers)} markers in {step.over:g} s"
        return Result(Outcome.FAIL, reason)
    markers = np.array(frames)
    positions, rotations, rms = fit_pose(markers.mean(axis=0)[None], np.array(stand.robot.markers))
    if np.isnan(rms[0]):
        return Result(Outcome.FAIL, "the markers seen lie on one line")
    found = (
        Measurement("markers peak to peak", float(np.ptp(markers, axis=0).max()), "m", high=step.still),
        Measurement("distance of the markers from those of the robot file, rms", float(rms[0]), "m", high=step.misfit),
    )
    outcome, reason = judge(found)
    lengths = Mechanism(stand.robot).lengths(positions, rotations)[0]
    return Result(outcome, reason, found, values=tuple(float(length) for length in lengths))


async def set_lengths(stand: Stand, step: SetLengths) -> Result:
    """Check that the encoders stand still, then store their counts. Values: changes, m."""
    clock, begin = stand.rig.clock, stand.rig.clock.now()
    seen = [stand.lengths()]
    while clock.now() - begin < step.over:
        await clock.sleep(POLL)
        seen.append(stand.lengths())
    moved = np.ptp(np.array(seen), axis=0)
    found = tuple(
        Measurement(f"movement of the encoder of cable {cable}", float(m), "m", high=step.still)
        for cable, m in enumerate(moved, start=1)
    )
    outcome, reason = judge(found)
    if not outcome.usable:
        return Result(outcome, reason, found)
    before = stand.lengths()
    settings = stand.settings.hold
    work = command_all([w.set_length(length) for w, length in zip(stand.rig.winches, step.lengths, strict=True)])
    try:
        await within(clock, settings.timeout, work)
    except TimeoutError:
        raise DeviceError("winches", f"do not accept their lengths within {settings.timeout:g} s") from None
    return Result(values=tuple(new - old for new, old in zip(step.lengths, before, strict=True)), measurements=found)
