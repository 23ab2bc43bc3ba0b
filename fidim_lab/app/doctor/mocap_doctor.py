"""Motion capture as `fidim doctor --rig` sees it: rate, delay, frames lost, markers seen and alive."""

from dataclasses import dataclass

import numpy as np

from drivers.mocap.clock_fit import fit_clock
from drivers.mocap.decoders import Upright, ViconDataStreamDecoder
from drivers.mocap.source import StreamMarkerSource
from drivers.ports import Clock, MarkerFrame
from fidim_lab.app.compose.motion_capture import marker_source
from fidim_lab.app.doctor.checks import Check, CheckVerdict
from fidim_lab.app.formats.aligned import known_alignment
from fidim_lab.data.rigs.rig import RigFile
from fidim_lab.errors import FidimError

DEVICE = "motion capture"
READY = 3.0
"""s for the first frame with the main marker"""
WATCH = 2.0
"""s"""
RATE_ERROR = 0.02
"""of the configured rate; a device that was set to another rate is far off"""
LOST = 0.01
"""part of the frames that may be missing"""
LATE = 0.05
"""s between the least delay and that of 99 % of the frames; older frames make guards and records late"""
SEEN = 0.98
"""part of the frames in which each marker must be"""


@dataclass(frozen=True)
class Watched:
    """What came while it was watched."""

    frames: tuple[MarkerFrame, ...]
    seconds: float
    counters: dict[str, int]
    """while it was watched"""


async def check_motion_capture(file: RigFile, clock: Clock) -> tuple[list[Check], Watched | None]:
    """Open the stream and watch it; what came, too."""
    entry = file.motion_capture
    wanted = f"{entry.kind} at {entry.place}"
    try:
        source = marker_source(file, clock)
    except FidimError as error:
        return [Check("stream", CheckVerdict.FAILED, error.message, error.hint, wanted, DEVICE)], None
    try:
        try:
            await source.start()
            await source.ready(READY)
        except FidimError as error:
            return [Check("stream", CheckVerdict.UNREACHABLE, error.message, error.hint, wanted, DEVICE)], None
        watched = await _watch(source, clock)
    finally:
        await source.close()
    names = entry.markers or tuple(f"marker {k}" for k in range(1, len(file.robot.markers) + 1))
    checks = [Check("stream", CheckVerdict.OK, "comes", wanted=wanted, device=DEVICE), *check_own_account(source)]
    checks += check_alignment(file)
    return [*checks, *check_timing(watched, entry.rate), *check_markers(watched, names)], watched


def check_alignment(file: RigFile) -> list[Check]:
    """How late the markers are against the encoders, where `align` has measured it for this rig file."""
    try:
        known = known_alignment(file)
    except FidimError as error:
        return [Check("alignment", CheckVerdict.FAILED, error.message, error.hint, device=DEVICE)]
    if known is None:
        return []
    found = f"{1e3 * known.lag:.2f} ms late, ±{1e3 * known.sd:.2f} ms, by a jog of {known.at}"
    return [Check("alignment", CheckVerdict.OK, found, device=DEVICE)]


def check_own_account(source: StreamMarkerSource) -> list[Check]:
    """What the system itself says of its delay, where it does."""
    decoder = source.decoder.inner if isinstance(source.decoder, Upright) else source.decoder
    if not isinstance(decoder, ViconDataStreamDecoder) or decoder.latency is None:
        return []
    return [Check("system's own latency", CheckVerdict.OK, f"{1e3 * decoder.latency:.1f} ms", device=DEVICE)]


async def _watch(source: StreamMarkerSource, clock: Clock) -> Watched:
    reader = source.frames()
    before, start = source.counters(), clock.now()
    await clock.sleep(WATCH)
    seconds, after = clock.now() - start, source.counters()
    frames: list[MarkerFrame] = []
    await source.close()  # the reader ends after what it has
    try:
        async for frame in reader:
            frames.append(frame)
    except FidimError:
        pass  # a gap shows in the counters
    return Watched(tuple(frames), seconds, {key: after[key] - before[key] for key in after})


def check_timing(watched: Watched, rate: float) -> list[Check]:
    """Rate by the device's counter, frames missing, delay beyond the least."""
    frames = watched.frames
    fit = fit_clock([f.number for f in frames], [f.t for f in frames], rate)
    if fit is None:
        found = f"{len(frames)} frames in {watched.seconds:.1f} s"
        return [Check("rate", CheckVerdict.FAILED, found, "is the stream paused?", f"{rate:g} Hz", DEVICE)]
    measured = (frames[-1].number - frames[0].number) / (frames[-1].t - frames[0].t)
    bad = abs(measured / rate - 1.0) > RATE_ERROR
    advice = "set rate in the rig file to what the device sends, or the device to it" if bad else ""
    checks = [_judged("rate", bad, f"{measured:.1f} Hz", advice, f"{rate:g} Hz")]
    lost = watched.counters["lost"] / max(1, watched.counters["received"] + watched.counters["lost"])
    advice = "look at the network: cable instead of radio, no other heavy traffic"
    checks.append(_judged("frames lost", lost > LOST, f"{lost:.1%}", advice, f"at most {LOST:.0%}"))
    late = float(np.quantile([f.t - fit.time(f.number) for f in frames], 0.99))
    checks.append(
        _judged("delay beyond the least, p99", late > LATE, f"{late * 1e3:.1f} ms", advice, f"{LATE * 1e3:g} ms")
    )
    return checks


def check_markers(watched: Watched, names: tuple[str, ...]) -> list[Check]:
    """Whether each marker is seen, and the main one lives."""
    checks: list[Check] = []
    count = max(1, len(watched.frames))
    for index, name in enumerate(names):
        seen = sum(frame.positions[index] is not None for frame in watched.frames) / count
        advice = "look for what hides it, and at its name at the sender"
        checks.append(_judged(f"{name} seen", seen < SEEN, f"{seen:.0%}", advice, f"at least {SEEN:.0%}"))
    repeated = watched.counters["repeated"] / max(1, watched.counters["received"])
    advice = "the stream repeats old positions: is the system paused, or the marker not tracked?"
    checks.append(_judged("positions repeated", repeated > 0.5, f"{repeated:.0%}", advice, "under 50%"))
    return checks


def _judged(name: str, bad: bool, found: str, advice: str, wanted: str) -> Check:
    return Check(name, CheckVerdict.FAILED if bad else CheckVerdict.OK, found, advice if bad else "", wanted, DEVICE)
