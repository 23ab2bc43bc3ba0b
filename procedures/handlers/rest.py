"""Handlers that measure the robot at rest: settling, encoders, tensions."""

import asyncio

import numpy as np

from procedures.expected.tensions import known_tensions, measured
from procedures.handlers.trace import MarkerTrace, load_cell_means, winch_means
from procedures.outcomes import Measurement, Outcome, judge
from procedures.stand import Stand
from procedures.steps import CheckTension, ReadEncoders, Result, Settle
from procedures.timing import POLL


async def settle(stand: Stand, step: Settle) -> Result:
    """Wait for rest; values are the marker's mean position."""
    clock, source = stand.rig.clock, stand.rig.markers
    trace = MarkerTrace(source.rate, step.over)
    begin = clock.now()
    while clock.now() - begin < step.timeout:
        trace.take(source.latest(), clock.now())
        if trace.full and trace.spread <= step.tolerance:
            still = Measurement("marker peak to peak", trace.spread, "m", high=step.tolerance)
            return Result(measurements=(still,), values=tuple(float(v) for v in trace.mean))
        stand.progress((clock.now() - begin) / step.timeout)
        await clock.sleep(POLL)
    spread = trace.spread if trace.full else None
    still = Measurement("marker peak to peak", spread, "m", high=step.tolerance)
    if spread is None:
        reason = (
            f"The main marker was seen too rarely for {step.timeout:g} s to decide whether the platform is at rest."
        )
        return Result(Outcome.FAIL, reason, (still,))
    reason = (
        f"The marker still moves {spread * 1e3:.1f} mm peak to peak after {step.timeout:g} s, "
        f"{step.tolerance * 1e3:g} mm is allowed."
    )
    return Result(Outcome.FAIL, reason, (still,))


async def read_encoders(stand: Stand, step: ReadEncoders) -> Result:
    """Mean lengths, each compared with what was asked for."""
    lengths = await winch_means(stand, step.over, lambda sample: sample.length)
    errors = tuple(
        Measurement(f"encoder error of cable {cable}", abs(found - wanted), "m", high=step.tolerance)
        for cable, (found, wanted) in enumerate(zip(lengths, step.lengths, strict=True), start=1)
    )
    outcome, reason = judge(errors)
    return Result(outcome, reason, errors, values=tuple(float(v) for v in lengths))


async def check_tension(stand: Stand, step: CheckTension) -> Result:
    """Mean tensions against limits, as well as each is known: by load cell, by calibrated current, or by current."""
    currents, lengths, cells = await asyncio.gather(
        winch_means(stand, step.over, lambda sample: sample.current),
        winch_means(stand, step.over, lambda sample: sample.length),
        load_cell_means(stand, step.over),
    )
    moved = [sample.moved for sample in stand.samples()]
    by_current = np.array(stand.newton_per_ampere) * currents
    known = known_tensions(by_current.tolist(), moved, stand.settings.tension.bands, cells)
    found = tuple(measured(cable, one, step.limits, step.tolerance) for cable, one in enumerate(known, start=1))
    outcome, reason = judge(found)
    readings = {"currents": currents.tolist(), "lengths": lengths.tolist(), "moved": moved}
    if len(cells) == len(known):
        readings["load_cells"] = [cells[cable][0] for cable in sorted(cells)]
    rounded = {name: tuple(float(v) for v in values) for name, values in readings.items()}
    return Result(outcome, reason, found, values=tuple(one.value for one in known), readings=rounded)
