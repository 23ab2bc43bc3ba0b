"""Serial devices as `fidim doctor --rig` sees them: the release's state, the rate and the lines of measuring devices.

Only questions are sent; nothing takes hold or lets go.
"""

import asyncio
import contextlib
from collections.abc import AsyncGenerator, Coroutine
from contextlib import asynccontextmanager
from dataclasses import replace
from typing import Any

from drivers.ports import Clock, ReleaseState
from drivers.serial_line.gauge import LineGauge
from drivers.serial_line.release import SerialRelease
from fidim_lab.app.compose.motion_capture import serial_devices
from fidim_lab.app.doctor.checks import Check, CheckVerdict
from fidim_lab.data.rigs.rig import RigFile
from fidim_lab.data.rigs.rig_serial import GaugeEntry
from fidim_lab.errors import FidimError

RELEASE = "release"
READY = 3.0
"""s for the first answer"""
WATCH = 2.0
"""s"""
LOOK = 0.05
"""s"""
RATE_ERROR = 0.1
"""of the declared rate"""
USELESS = 0.05
"""part of the lines that may not look like the pattern"""


async def check_serial(file: RigFile, clock: Clock) -> list[Check]:
    """Open each device, and listen."""
    try:
        devices = serial_devices(file, clock)
    except FidimError as error:
        return [Check("serial devices", CheckVerdict.FAILED, error.message, error.hint)]
    checks: list[Check] = []
    if devices.release is not None:
        checks += await _check_release(devices.release, clock)
    kinds = [entry.what for entry in file.gauges]
    for gauge, entry in zip(devices.gauges, file.gauges, strict=True):
        name = entry.what if kinds.count(entry.what) == 1 else entry.name
        checks += [replace(check, device=name) for check in await _check_gauge(gauge, entry, clock)]
    return checks


async def _check_release(release: SerialRelease, clock: Clock) -> list[Check]:
    async with _running(release.run(lets_go=False)):
        deadline = clock.now() + READY
        while release.state is ReleaseState.UNKNOWN and clock.now() < deadline:
            await clock.sleep(LOOK)
        if release.state is ReleaseState.UNKNOWN:
            heard = f"{release.ignored} lines without a state" if release.ignored else "no answer"
            advice = "check plug, baud, and the texts of ask, holds and released"
            return [Check("state", CheckVerdict.UNREACHABLE, release.problem or heard, advice, device=RELEASE)]
        held = release.state is ReleaseState.HOLDS
        advice = "it holds something already: is another program using it?" if held else ""
        verdict = CheckVerdict.WARNING if held else CheckVerdict.OK
        return [Check("state", verdict, f"{release.state}", advice, f"{ReleaseState.RELEASED}", RELEASE)]


async def _check_gauge(gauge: LineGauge, entry: GaugeEntry, clock: Clock) -> list[Check]:
    async with _running(gauge.run()):
        deadline = clock.now() + READY
        while gauge.latest() is None and clock.now() < deadline:
            await clock.sleep(LOOK)
        if gauge.latest() is None:
            return [_silent(gauge)]
        before, start, old = gauge.counters.lines, clock.now(), gauge.counters.malformed
        await clock.sleep(WATCH)
        lines, seconds = gauge.counters.lines - before, clock.now() - start
        return [_value(gauge), *_lines(entry, lines, gauge.counters.malformed - old, seconds)]


def _silent(gauge: LineGauge) -> Check:
    heard = f"{gauge.counters.malformed} lines, none like the pattern" if gauge.counters.malformed else "no line"
    advice = "check plug, baud, pattern, and whether it must be asked"
    return Check("readings", CheckVerdict.UNREACHABLE, gauge.problem or heard, advice, gauge.config.pattern)


def _value(gauge: LineGauge) -> Check:
    reading = gauge.latest()
    values = () if reading is None else reading.values
    shown = ", ".join(f"{column} {value:.4g}" for column, value in zip(gauge.columns, values, strict=True))
    return Check("readings", CheckVerdict.OK, shown, wanted=gauge.config.pattern)


def _lines(entry: GaugeEntry, lines: int, malformed: int, seconds: float) -> list[Check]:
    rate = lines / seconds
    bad = abs(rate / entry.rate - 1.0) > RATE_ERROR and abs(lines - entry.rate * seconds) > 1.5
    advice = "set rate in the rig file to what the device sends, or the device to it" if bad else ""
    verdict = CheckVerdict.WARNING if bad else CheckVerdict.OK
    checks = [Check("rate", verdict, f"{rate:.1f} Hz", advice, f"{entry.rate:g} Hz")]
    share = malformed / max(lines, 1)
    if share > USELESS:
        advice = "compare the lines with the pattern (a terminal program shows them); is the device beyond its range?"
        checks.append(Check("lines not like the pattern", CheckVerdict.FAILED, f"{share:.0%}", advice))
    return checks


@asynccontextmanager
async def _running(work: Coroutine[Any, Any, None]) -> AsyncGenerator[None]:
    task = asyncio.ensure_future(work)
    try:
        yield
    finally:
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task
