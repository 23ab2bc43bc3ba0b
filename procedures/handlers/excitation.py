"""Handlers of winch-driven excitation. Strokes are moves of profile position mode; only the time of each matters."""

import asyncio
from collections import deque
from typing import TYPE_CHECKING

import numpy as np

from fidim_lab.errors import DeviceError
from procedures.handlers.motion import command_all
from procedures.outcomes import Measurement, Outcome
from procedures.stand import Stand
from procedures.steps import Result, longest_way
from procedures.steps.excitation import SeeRecordedSwing, StrokeChain, Strokes, Think, WatchSwing, swing_values
from procedures.timing import POLL, wait_until

if TYPE_CHECKING:
    from fidim_lab.identification.excitation.seen import SwingOscillations
    from fidim_lab.model.swing import Swing

TAKEN = 0.01
"""s from a command until a drive moves: two or three cycles of the bus"""
LATE = 0.03
"""s by which strokes that have a time may come late"""
ARRIVAL = 2.0
"""s for the last stroke to end after its time"""
RESTING = 2.0
"""tolerances by which the winches may be off where strokes begin"""


async def strokes(stand: Stand, step: Strokes) -> Result:
    """Carry out all chains; the equilibrium's lengths are checked before and after, and both ends of every stroke.

    FAIL, with nothing moved, where a stroke would leave the workspace.
    """
    clock = stand.rig.clock
    off = longest_way(stand.lengths(), step.lengths)
    if off > RESTING * step.tolerance:
        raise DeviceError("winches", f"are {off * 1e3:.1f} mm from the start of the strokes; something has moved them")
    for target in (target for chain in step.chains for target in chain.targets):
        wrong = stand.workspace.between(step.lengths, target)
        if wrong is not None:
            return Result(Outcome.FAIL, f"a stroke would leave the robot's limits: {wrong}")
    begin: float | None = None
    for chain in step.chains:
        await _prepare(stand, chain)
        if begin is None:
            begin = clock.now() if step.begin is None else step.begin - TAKEN
            if clock.now() > begin + LATE:
                return Result(Outcome.FAIL, f"the winches were ready {clock.now() - begin:.2f} s too late")
        await _strike(stand, chain, begin + chain.begin, step)

    def held() -> bool:
        samples = stand.samples()
        near = longest_way(tuple(s.length for s in samples), step.lengths) <= step.tolerance
        return near and all(s.target_reached for s in samples)

    if not await wait_until(clock, ARRIVAL, held):
        raise DeviceError("winches", f"are not back at the equilibrium {ARRIVAL:g} s after the last stroke")
    return Result(values=(clock.now(),))


async def _prepare(stand: Stand, chain: StrokeChain) -> None:
    profiles = zip(stand.rig.winches, chain.speeds, chain.accelerations, strict=True)
    await command_all([winch.prepare(speed, ramp) for winch, speed, ramp in profiles if speed > 0])


async def _strike(stand: Stand, chain: StrokeChain, begin: float, step: Strokes) -> None:
    clock = stand.rig.clock
    for start, target in zip(chain.starts, chain.targets, strict=True):
        while (left := begin + start - clock.now()) > 1e-6:
            stand.progress((clock.now() - begin + chain.begin) / step.seconds)
            await clock.sleep(min(left, 0.1))
        moving = zip(stand.rig.winches, target, chain.speeds, chain.accelerations, strict=True)
        await command_all([winch.move_to(length, v, a) for winch, length, v, a in moving if v > 0])
    await clock.sleep(max(begin + chain.seconds - clock.now(), 0.0))


async def watch_swing(stand: Stand, step: WatchSwing) -> Result:
    """Fit oscillations to what the marker does now."""
    clock, source = stand.rig.clock, stand.rig.markers
    begin, number = clock.now(), -1
    taken: deque[tuple[float, tuple[float, float, float]]] = deque()
    while clock.now() - begin < step.over:
        frame = source.latest()
        if frame is not None and frame.number != number:
            number = frame.number
            if frame.main is not None:
                taken.append((frame.t, frame.main))
        stand.progress((clock.now() - begin) / step.over)
        await clock.sleep(POLL)
    t, places = np.array([at for at, _ in taken]), np.array([place for _, place in taken]).reshape(-1, 3)
    return await _told(step.swing, t, places, None, at_end=True)


async def see_recorded_swing(stand: Stand, step: SeeRecordedSwing) -> Result:
    """The same for the recording just made, at its begin."""
    recording = stand.recorder.last(step.window, step.attempt)
    places = recording.markers[:, 0]
    rest = np.array(step.rest) if step.rest else None
    return await _told(step.swing, np.arange(len(places)) / recording.rate, places, rest, at_end=False)


async def _told(swing: "Swing", t: np.ndarray, places: np.ndarray, rest: np.ndarray | None, *, at_end: bool) -> Result:
    """In a thread: a fit takes some tens of milliseconds."""

    def fit() -> "SwingOscillations | None":
        from fidim_lab.identification.excitation.seen import seen_swing  # what excites has imported it

        return seen_swing(swing, t, places, rest=rest, at_end=at_end)

    seen = await asyncio.get_running_loop().run_in_executor(None, fit)
    if seen is None:
        return Result(Outcome.FAIL, "the main marker was seen too rarely to measure the swing")
    found = tuple(
        Measurement(f"swing of mode {mode}", float(value), "m") for mode, value in enumerate(seen.amplitudes, start=1)
    )
    return Result(measurements=found, values=swing_values(seen, swing))


async def think(_stand: Stand, step: Think) -> Result:
    """In a thread."""
    await asyncio.get_running_loop().run_in_executor(None, step.job)
    return Result()
