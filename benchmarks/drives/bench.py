"""One winch on a drive that is simulated from its maker's dictionary, walked from bring-up to power-off."""

import asyncio
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from drivers.cia402.dictionary import DriveFamily, Graded, Load, TrialPassed, WinchConfig
from drivers.cia402.dictionary.fitted import fitted
from drivers.cia402.motion import make_winch
from drivers.cia402.watch import CanopenMaster
from drivers.clock import LoopClock
from drivers.ports import DriveState, Trial, WinchSample
from fidim_lab.app.compose.simulators import make_of
from fidim_lab.errors import DeviceError, FidimError
from sim_backends.drive.axis import DrumShaft
from sim_backends.drive.node import SimulatedDrive
from sim_backends.drive.objects import read_eds
from sim_backends.in_process_bus import InProcessBus
from sim_backends.jumping_loop import run

NODE = 5
CURRENT = 1.5
"""A in the motor"""
SPEED = 0.1
"""m/s of the moves"""
PROOFS = tuple(
    TrialPassed(trial, 0, 0.02, 0.1, 1e-4, "A. Name", "2026-11-25T10:00:00", trial is Trial.LOST_HEARTBEAT)
    for trial in Trial
    if trial is not Trial.FOLLOWING_ERROR
)
"""as if every trial had been passed that can be made without 6065, by a drive without a serial number"""


def winch_config(eds: Path, family: DriveFamily, **change: Any) -> WinchConfig:
    """A winch of a plausible robot: gear 10, 40 000 counts a turn of the drum, 5 A and 1 N m."""
    usual: dict[str, Any] = {
        "name": "winch 5",
        "node_id": NODE,
        "counts_per_turn": 40_000.0,
        "motor_counts": 4_000.0,
        "drum_radius": 0.03,
        "rated_current": 5.0,
        "current_limit": 4.0,
        "max_speed": 0.3,
        "max_acceleration": 2.0,
        "length_limits": (0.3, 3.0),
        "home_length": 1.0,
        "eds": eds,
        "vendor_id": 0,
        "product_code": 0,
        "family": family,
        "load": Load.VENDOR if family.load_object else Load(family.load),
        "rated_torque": 1.0,
        "torque_constant": 0.2,
        "proofs": PROOFS,
    }
    return WinchConfig(**(usual | change))


class DriveBench:
    """The winch, its master, the drive and the bus between them; to be entered inside the jumping loop."""

    def __init__(self, config: WinchConfig) -> None:
        self.clock = LoopClock()
        self.bus = InProcessBus(self.clock.now)
        self.config = fitted(config)
        shaft = DrumShaft()
        shaft.set_load(-CURRENT)
        od = read_eds(config.eds, NODE)
        od.fix(0x6075, 0, 5000)
        od.fix(0x6076, 0, 1000)
        od.fix(0x1018, 4, 0)  # the drive that was tried
        if (own := config.family.rated_current) is not None:
            od.fix(own.index, own.sub, round(5.0 / own.ampere))
        self.drive = SimulatedDrive(NODE, od, shaft, make=make_of(config))
        self.bus.attach(self.drive)
        self.master = CanopenMaster(self.bus, self.clock)
        self.winch = make_winch(self.config, self.master)
        self.tasks: list[asyncio.Task[None]] = []

    async def __aenter__(self) -> "DriveBench":
        self.tasks = [asyncio.ensure_future(self.master.run()), asyncio.ensure_future(self._world())]
        return self

    async def __aexit__(self, *_: object) -> None:
        for task in self.tasks:
            task.cancel()
        await asyncio.gather(*self.tasks, return_exceptions=True)

    async def _world(self) -> None:
        while True:
            self.bus.advance(self.clock.now())
            await self.clock.sleep(0.005)

    async def arrive(self, length: float) -> None:
        """Raises DeviceError where the winch is not at this length (m) within 5 s."""
        for _ in range(100):
            await self.clock.sleep(0.05)
            sample = self.winch.latest()
            if sample is not None and sample.target_reached and abs(sample.length - length) < 2e-4:
                return
        raise DeviceError(self.config.device, f"is not at {length} m: {self.winch.latest()}")

    def look(self) -> WinchSample:
        """The newest sample. Raises DeviceError where there is none."""
        sample = self.winch.latest()
        if sample is None:
            raise DeviceError(self.config.device, "has no sample.")
        return sample


@dataclass(frozen=True)
class Walked:
    """What a walk came to."""

    stage: str
    """the last one that was begun; "power off" and no problem: the whole way"""
    problem: str
    """why it ended there; empty where it did not"""
    grades: tuple[Graded, ...] = ()
    tells_load: bool = False


def walk(config: WinchConfig) -> Walked:
    """Bring-up, enable, move, hold, quick stop, power off; each by what the drive tells and where it stands."""
    stages: list[str] = []

    async def script() -> Walked:
        async with DriveBench(config) as bench:
            return await _walk(bench, stages)

    try:
        stages.append("simulated")
        return run(script())
    except FidimError as error:
        return Walked(stages[-1], error.message)


async def _walk(bench: DriveBench, stages: list[str]) -> Walked:
    winch, look = bench.winch, bench.look

    def require(holds: bool, says: str) -> None:
        if not holds:
            raise DeviceError(bench.config.device, f"{says}: {winch.latest()}")

    stages.append("bring-up")
    await winch.configure()
    stages.append("enable")
    await winch.enable()
    require(look().state is DriveState.OPERATION_ENABLED, "is not enabled")
    stages.append("move")
    await winch.move_to(1.1, SPEED, 0.5)
    await bench.clock.sleep(0.6)
    require(abs(look().velocity - SPEED) < 0.02 * SPEED, f"does not tell {SPEED} m/s")
    current = look().current
    require(math.isnan(current) or abs(current - CURRENT) < 0.01 * CURRENT, f"does not tell {CURRENT} A")
    await bench.arrive(1.1)
    stages.append("hold")
    await winch.move_to(1.3, SPEED, 0.5)
    await bench.clock.sleep(0.6)
    await winch.hold()
    held = look().length
    require(1.12 < held < 1.2, "does not hold on its way")
    stages.append("quick stop")
    await winch.move_to(1.0, SPEED, 0.5)
    await bench.clock.sleep(0.6)
    winch.quick_stop()
    await bench.clock.sleep(0.5)
    require(look().velocity == 0.0 and look().length < held and not look().fault, "does not stand after a quick stop")
    stages.append("power off")
    winch.power_off()
    await bench.clock.sleep(0.1)
    require(look().state is DriveState.SWITCH_ON_DISABLED, "still has power")
    return Walked(stages[-1], "", winch.grades, tells_load=not math.isnan(current))
