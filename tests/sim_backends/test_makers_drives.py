"""Drives of many makers, each simulated from its maker's own dictionary: bring-up, move, hold, quick stop, power off.

The files are not ours to ship: they lie in ../shared/eds, and these tests are skipped where they do not.
"""

import asyncio
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from drivers.cia402.dictionary import Load, Met, TrialPassed, WinchConfig, read_family
from drivers.cia402.dictionary.family import FOLDER
from drivers.cia402.dictionary.fitted import by_file, fitted
from drivers.cia402.dictionary.requirements import REQUIREMENTS, Trial
from drivers.cia402.motion import make_winch
from drivers.cia402.profile import Mode
from drivers.cia402.watch import CanopenMaster
from drivers.clock import LoopClock
from drivers.ports import DriveState
from fidim_lab.app.compose.simulators import make_of
from fidim_lab.data.eds import read_dictionary
from fidim_lab.errors import DeviceError
from sim_backends.drive.axis import DrumShaft
from sim_backends.drive.node import SimulatedDrive
from sim_backends.drive.objects import AbortCode, read_eds
from sim_backends.drive.objects.eds import make_dictionary
from sim_backends.in_process_bus import InProcessBus
from sim_backends.jumping_loop import run

pytestmark = pytest.mark.shared
NODE = 5
CURRENT = 1.5
"""A in the motor"""


@dataclass(frozen=True)
class Make:
    """One drive: the end of its file's name, its family, what its table must say."""

    file: str
    family: str
    by_trial: frozenset[str] = frozenset()
    """requirements that its objects cannot configure"""
    tells_load: bool = True
    mode: Mode = Mode.PROFILE_POSITION
    reactions: dict[str, int] = field(default_factory=dict[str, int])


LOST_HOST = frozenset({"reaction to a lost host"})
NO_STOPS = LOST_HOST | {"quick-stop reaction", "halt reaction", "fault reaction"}
MAKES = {
    "Maxon EPOS4": Make("mile800_node1_hm.dcf", "maxon-epos4", frozenset({"halt reaction"})),
    "Nanotec CL4-E": Make("nanotec__CL4-E-2-12.eds", "nanotec", LOST_HOST),
    "Technosoft iPOS": Make("config__technosoft.eds", "technosoft-ipos"),  # by life guarding
    "Faulhaber MCBL": Make(
        "eds__Faulhaber__605.3150.67-B-EK-2-60.eds", "faulhaber", NO_STOPS | {"following-error limit"}
    ),
    "Trinamic TMCM-1636": Make("TMCM-1636-CANopen_Hw1.1_Fw1.12.eds", "trinamic-bldc", LOST_HOST),
    "Trinamic TMCM-1160": Make("TMCM_1160.eds", "trinamic-stepper", LOST_HOST, tells_load=False),
    "Elmo Gold": Make("canopen_test_utils__config__Elmo.dcf", "elmo-gold"),
    "Elmo Gold, cyclic": Make("canopen_test_utils__config__Elmo.dcf", "elmo-gold", mode=Mode.CYCLIC_POSITION),
    "Lexium MDrive": Make("SchneiderElectric__NEMA23.eds", "schneider-lexium-mdrive"),  # by life guarding
    "Infranor Easy-ak": Make("Easy-ak_v1.30.eds", "infranor", LOST_HOST | {"halt reaction", "fault reaction"}),
    "Roboteq": Make("roboteq_motor_controllers_v2.0-30-01-2019.eds", "roboteq", NO_STOPS | {"following-error limit"}),
    "Schunk": Make("canopen_test_utils__config__Schunk_0_63.dcf", "schunk", NO_STOPS),
    "Pilz PRBT": Make("robot_control__prbt_0_1.dcf", "schunk", NO_STOPS),
    "IDM (two entries a PDO)": Make("ISD860.dcf", "generic", NO_STOPS, tells_load=False),
    "the profile's sample": Make("eds_library__cia__402.eds", "generic", LOST_HOST, tells_load=False),
}
FIXED_PDOS = tuple(
    f"605.3150.{number}-{rest}-60.eds"
    for number, rest in [(51, "V-EK-2"), (52, "V-EK-2"), (60, "B-EK-2"), (66, "B-EK-2"), (71, "A-EK-3")]
)
"""Faulhaber's older firmware: no PDO carries its position; refused"""
PROOFS = tuple(TrialPassed(trial, 0, 0.02, 0.1, 1e-4, "A. Name", "2026-11-25T10:00:00") for trial in Trial)


def folder_of(shared: Path) -> Path:
    folder = shared / "eds"
    if not folder.is_dir():
        pytest.skip(f"{folder} is absent: it holds EDS files of makers, which are not ours to ship")
    return folder


def file_of(make: Make, shared: Path) -> Path:
    return next(path for path in sorted(folder_of(shared).iterdir()) if path.name.endswith(make.file))


@pytest.fixture(params=MAKES)
def made(request: pytest.FixtureRequest, shared: Path) -> tuple[Make, Path]:
    return MAKES[request.param], file_of(MAKES[request.param], shared)


def winch_config(make: Make, eds: Path, **change: Any) -> WinchConfig:
    family = read_family(FOLDER / f"{make.family}.toml")
    usual: dict[str, Any] = {
        "name": "winch 5",
        "node_id": NODE,
        "counts_per_turn": 40_000.0,  # of the drum: gear 10
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
        "mode": make.mode,
        "load": Load.VENDOR if family.load_object else Load(family.load),
        "rated_torque": 1.0,
        "torque_constant": 0.2,  # 5 A are 1 N m
        "proofs": PROOFS,
    }
    return WinchConfig(**(usual | change))


class Bench:
    """One winch on a drive that is simulated from its maker's dictionary."""

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

    async def __aenter__(self) -> "Bench":
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

    async def there(self, length: float) -> None:
        for _ in range(100):
            await self.clock.sleep(0.05)
            sample = self.winch.latest()
            if sample is not None and sample.target_reached and abs(sample.length - length) < 2e-4:
                return
        pytest.fail(f"not at {length} m: {self.winch.latest()}")

    def look(self) -> Any:
        sample = self.winch.latest()
        assert sample is not None
        return sample


def test_it_walks_from_bring_up_to_power_off(made):
    make, eds = made

    async def walk() -> None:
        async with Bench(winch_config(make, eds)) as bench:
            winch, look = bench.winch, bench.look
            await winch.configure()
            by_trial = {line.requirement.key for line in winch.grades if line.met is Met.TRIAL}
            assert by_trial == make.by_trial
            assert not [line for line in winch.grades if line.met is Met.ABSENT]
            await winch.enable()
            assert look().state is DriveState.OPERATION_ENABLED
            await winch.move_to(1.1, 0.1, 0.5)
            await bench.clock.sleep(0.6)
            assert look().velocity == pytest.approx(0.1, rel=0.02), "its unit of speed"
            if make.tells_load:
                assert look().current == pytest.approx(CURRENT, rel=0.01)
            else:
                assert math.isnan(look().current)
            await bench.there(1.1)
            await winch.move_to(1.3, 0.1, 0.5)
            await bench.clock.sleep(0.6)
            await winch.hold()
            held = look().length
            assert 1.12 < held < 1.2
            await winch.move_to(1.0, 0.1, 0.5)
            await bench.clock.sleep(0.6)
            winch.quick_stop()
            await bench.clock.sleep(0.5)
            assert look().velocity == 0.0
            assert look().length < held
            assert look().fault == ""
            winch.power_off()
            await bench.clock.sleep(0.1)
            assert look().state is DriveState.SWITCH_ON_DISABLED

    run(walk())


@pytest.mark.parametrize("name", ["Faulhaber MCBL", "Maxon EPOS4", "Nanotec CL4-E"])
def test_what_no_trial_has_proven_is_refused_before_anything_is_written(shared, name):
    make = MAKES[name]
    eds = file_of(make, shared)

    async def walk() -> None:
        async with Bench(winch_config(make, eds, proofs=())) as bench:
            with pytest.raises(DeviceError, match="neither configured nor proven by trial") as caught:
                await bench.winch.configure()
            assert all(f"{key} (" in str(caught.value) for key in make.by_trial)
            assert bench.drive.od.number(0x607F) != bench.config.drive_speed(bench.config.max_speed)

    run(walk())


def test_every_dictionary_is_read_graded_and_simulated(shared):
    """No file of a maker is refused: drives stand at their node id, what is no drive is said to be none."""
    drives, others = 0, 0
    for path in {path.name.split("__")[-1]: path for path in sorted(folder_of(shared).iterdir())}.values():
        found = read_dictionary(path, NODE)
        od = make_dictionary(found, NODE)
        able, grades = by_file(found.dictionary, winch_config(Make(path.name, "generic"), path))
        if isinstance(od.find(0x6040), AbortCode):
            others += 1
            assert not able.has(0x6040), path.name
            continue
        drives += 1
        drive = SimulatedDrive(NODE, od, DrumShaft())
        assert (0x700 + NODE, b"\0") in drive.start(0.0), path.name
        assert od.number(0x1000) & 0xFFFF in (402, 0x191), path.name
        assert all(pdo_id & 0x7F == NODE for pdo_id in drive.listens if pdo_id > 0x100), path.name
        assert [line.requirement.key for line in grades] == [r.key for r in REQUIREMENTS], path.name
        lacks = [line.found for line in grades if line.met is Met.ABSENT and not line.requirement.trials]
        assert bool(lacks) == path.name.endswith(FIXED_PDOS), path.name
    assert (drives, others) == (32, 23)


def test_what_the_drive_does_not_guard_the_area_is_smaller_for(shared):
    lexium, roboteq = MAKES["Lexium MDrive"], MAKES["Roboteq"]
    config = winch_config(lexium, file_of(lexium, shared), quick_stop_deceleration=2.0, proofs=())
    assert fitted(config).length_limits == pytest.approx((0.3225, 2.9775)), "0.3² / (2 · 2) m from each end"
    weak = TrialPassed(Trial.QUICK_STOP, 0, 0.02, 0.04, 4e-4)  # 0.5 m/s²
    needs = winch_config(roboteq, file_of(roboteq, shared), proofs=(weak,))
    assert fitted(needs).max_speed == pytest.approx(0.15), "a quarter of the deceleration, half the speed"
