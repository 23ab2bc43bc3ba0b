"""Time: how well marker frames and drive samples are dated, against simulated truth.

Relative: `fit_clock`'s fit of a stream against the true exposures, up to the constant delay that arrivals cannot show.
Absolute: a winch jogs for some seconds; the delay of the markers against the encoder is the lag of best correlation.
"""

import asyncio
import math
from dataclasses import dataclass

import numpy as np

from benchmarks.bus.devices import MARKERS, simulated_drives, winch_config
from benchmarks.page import table
from drivers.cia402.motion import Cia402Winch, make_winch
from drivers.cia402.profile import Mode
from drivers.cia402.watch import CanopenMaster
from drivers.clock import LoopClock
from drivers.mocap.clock_fit import ClockFit, fit_clock
from drivers.mocap.decoders import MarkerObjects, ViconUdpDecoder
from drivers.mocap.source import StreamMarkerSource
from fidim_lab.data.alignment import ClockOffset, align_clocks
from sim_backends.drive.axis import DrumShaft
from sim_backends.in_process_bus import InProcessBus
from sim_backends.jumping_loop import run
from sim_backends.mocap.encoders import ViconEncoder
from sim_backends.mocap.server import MocapServer, ServerFeed, StreamTiming

RATE = 200.0
"""Hz, of the markers"""
LATENCY, JITTER, SPIKES, DRIFT = 4e-3, 0.5e-3, 0.01, 30e-6
"""s, s (mean, exponential), share of frames that are ten times as late, of the device's clock"""
NOISE = 1e-4
"""m, of a marker"""
JOG = 12.0
"""s"""
PLACES = (1.05, 0.97, 1.02, 0.95)
"""m"""
SPEED, ACCELERATION = 0.2, 1.0
RELATIVE, ABSOLUTE = 1e-4, 1e-3
"""s, what is asked"""
SYNCS = (100.0, 250.0, 500.0)


@dataclass(frozen=True, eq=False)
class Jog:
    """One simulated jog, as the drivers recorded it, and its truth."""

    frames: np.ndarray
    """(F, 3): number, arrival (host s), the marker's coordinate along the cable (m)"""
    samples: np.ndarray
    """(N, 2): host s of the SYNC, cable length by the encoder (m)"""
    start: float
    """host s of the first exposure"""

    def exposure(self, number: np.ndarray) -> np.ndarray:
        """True host s at which a frame was taken."""
        return self.start + (number - 1) * (1.0 + DRIFT) / RATE

    def fit(self) -> ClockFit:
        """Of the whole stretch. Raises ValueError for too few frames."""
        fit = fit_clock(self.frames[:, 0].astype(int).tolist(), self.frames[:, 1].tolist(), RATE)
        if fit is None:
            raise ValueError("too few frames")
        return fit

    def offset(self) -> ClockOffset:
        """Markers, dated by their fit, against encoder samples."""
        fit, numbers = self.fit(), self.frames[:, 0]
        dated = fit.offset + fit.rate * fit.period * (numbers - fit.reference)
        t, lengths = self.samples.T
        even = np.arange(t[0], t[-1], float(np.median(np.diff(t))))
        return align_clocks(even, np.interp(even, t, lengths)[:, None], dated, self.frames[:, 2:])


def alignment(seeds: int) -> str:
    """The table."""
    rows: list[tuple[str, str, str]] = []
    for sync in SYNCS:
        jogs = [jog(seed, sync) for seed in range(seeds)]
        relative = [float(np.max(np.abs(_relative(one)))) for one in jogs]
        offsets = [one.offset() for one in jogs]
        wrong = np.array([found.offset - LATENCY for found in offsets])
        stated = np.abs(wrong) / np.array([found.sd for found in offsets])
        name = f"SYNC {sync:g} Hz"
        rows.append(
            (f"{name}: relative, worst within each jog: median, worst", _ms(relative), f"{1e3 * RELATIVE:g} ms")
        )
        rows.append((f"{name}: absolute, by the jog: median, worst", _ms(np.abs(wrong)), f"{1e3 * ABSOLUTE:g} ms"))
        within = f"{float(np.mean(stated < 2.0)):.0%}, {stated.max():.1f} sd"
        rows.append((f"{name}: error within 2 sd of what is stated; worst", within, "95 %"))
        print(rows[-3:], flush=True)
    how = f"{seeds} jogs of {JOG:g} s with one winch, {RATE:g} Hz markers with {1e3 * NOISE:g} mm of noise, "
    how += (
        f"{1e6 * DRIFT:g} ppm of drift, {1e3 * LATENCY:g} ms of latency with {1e3 * JITTER:g} ms of exponential jitter "
    )
    how += (
        f"and {SPIKES:.0%} of spikes; drivers and devices in virtual time, so no scheduler is in it. The marker hangs "
    )
    how += "on the cable: with a platform between them, its geometry comes in as well."
    return table(["", "error", "asked"], rows) + f"\n\n{how}"


def _relative(one: Jog) -> np.ndarray:
    """(F,) error of each frame's date, s, but for the constant latency."""
    fit, numbers = one.fit(), one.frames[:, 0]
    dated = np.array([fit.time(number) for number in numbers])
    return dated - one.exposure(numbers) - LATENCY


def _ms(values: "np.ndarray | list[float]") -> str:
    return "{:.4f}, {:.4f} ms".format(*1e3 * np.quantile(values, (0.5, 1.0)))


def jog(seed: int, sync: float, mode: Mode = Mode.PROFILE_POSITION) -> Jog:
    """Simulate one, in virtual time."""
    return run(_jog(seed, sync, mode))


async def _jog(seed: int, sync: float, mode: Mode) -> Jog:
    clock, rng = LoopClock(), np.random.default_rng(seed)
    await clock.sleep(float(rng.uniform(0.0, 1.0)))  # any phase between SYNC and exposures
    config, shafts = winch_config(1, mode), [DrumShaft() for _ in range(4)]
    bus = InProcessBus(clock.now)
    bus.attach(simulated_drives(shafts)[0])
    master = CanopenMaster(bus, clock, sync_rate=sync)
    winch = make_winch(config, master)
    samples: list[tuple[float, float]] = []

    def truth(t: float) -> np.ndarray:
        return np.array([[0.0, 0.0, config.home_length + shafts[0].motion(t).position / config.scale.counts_per_metre]])

    def sample(_t: float) -> None:
        if (newest := winch.latest()) is not None:
            samples.append((newest.t, newest.length))

    timing = StreamTiming(RATE, DRIFT, LATENCY, JITTER, SPIKES)
    server = MocapServer(truth, ViconEncoder(MARKERS), rng, timing, NOISE)
    source = StreamMarkerSource(ServerFeed(server, clock), ViconUdpDecoder(MarkerObjects(MARKERS)), clock, rate=RATE)
    tasks = [asyncio.create_task(master.run(sample)), asyncio.create_task(_live(bus, clock))]
    try:
        await winch.configure()
        await winch.enable()
        samples.clear()
        begun = clock.now()
        await source.start()
        reading = asyncio.create_task(_frames(source, math.floor(JOG * RATE)))
        await clock.sleep(0.0)
        moving = asyncio.create_task(_move(clock, winch))
        frames = await reading
        moving.cancel()
        await asyncio.gather(moving, return_exceptions=True)
    finally:
        await source.close()
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
    return Jog(np.array(frames), np.array(samples), begun + timing.period)


async def _frames(source: StreamMarkerSource, count: int) -> list[tuple[float, float, float]]:
    found: list[tuple[float, float, float]] = []
    async for frame in source.frames():
        if (place := frame.positions[0]) is not None:
            found.append((frame.number, frame.t, place[2]))
        if len(found) >= count:
            break
    return found


async def _live(bus: InProcessBus, clock: LoopClock) -> None:
    while True:
        bus.advance(clock.now())
        await clock.sleep(min(max(bus.due - clock.now(), 1e-4), 0.05))


async def _move(clock: LoopClock, winch: Cia402Winch) -> None:
    while True:
        for place in PLACES:
            await winch.move_to(place, SPEED, ACCELERATION)
            while not ((newest := winch.latest()) and newest.target_reached):
                await clock.sleep(0.02)
