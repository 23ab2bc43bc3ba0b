"""Drives of many makers, each simulated from its maker's own dictionary: bring-up, move, hold, quick stop, power off.

The files are not ours to ship: they lie in ../shared/eds, and these tests are skipped where they do not.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from benchmarks.drives.bench import DriveBench, walk, winch_config
from benchmarks.drives.count import Counted, count, files_in, summary
from drivers.cia402.dictionary import Met, TrialPassed, WinchConfig, read_family
from drivers.cia402.dictionary.family import FOLDER
from drivers.cia402.dictionary.fitted import by_file, fitted
from drivers.cia402.dictionary.requirements import REQUIREMENTS, Trial
from drivers.cia402.profile import Mode
from fidim_lab.data.eds import read_dictionary
from fidim_lab.errors import DeviceError
from sim_backends.drive.axis import DrumShaft
from sim_backends.drive.node import SimulatedDrive
from sim_backends.drive.objects import AbortCode
from sim_backends.drive.objects.eds import make_dictionary
from sim_backends.jumping_loop import run

pytestmark = pytest.mark.shared
NODE = 5
PAGE = Path(__file__).parents[2] / "docs" / "rig.md"


@dataclass(frozen=True)
class Make:
    """One drive: the end of its file's name, its family, what its table must say."""

    file: str
    family: str
    by_trial: frozenset[str] = frozenset()
    """requirements that its objects cannot configure"""
    tells_load: bool = True
    mode: Mode = Mode.PROFILE_POSITION


LOST_HOST = frozenset({"reaction to a lost host"})
NO_STOPS = LOST_HOST | {"quick-stop reaction", "halt reaction", "fault reaction"}
MAKES = {
    "Maxon EPOS4": Make("mile800_node1_hm.dcf", "maxon-epos4", frozenset({"halt reaction"})),
    "Nanotec CL4-E": Make("nanotec__CL4-E-2-12.eds", "nanotec", LOST_HOST),
    "Technosoft iPOS": Make("config__technosoft.eds", "technosoft-ipos"),  # by life guarding
    "Faulhaber MCBL": Make("eds__Faulhaber__605.3150.67-B-EK-2-60.eds", "faulhaber", NO_STOPS),
    "Trinamic TMCM-1636": Make("TMCM-1636-CANopen_Hw1.1_Fw1.12.eds", "trinamic-bldc", LOST_HOST),
    "Trinamic TMCM-1160": Make("TMCM_1160.eds", "trinamic-stepper", LOST_HOST, tells_load=False),
    "Elmo Gold": Make("canopen_test_utils__config__Elmo.dcf", "elmo-gold"),
    "Elmo Gold, cyclic": Make("canopen_test_utils__config__Elmo.dcf", "elmo-gold", mode=Mode.CYCLIC_POSITION),
    "Lexium MDrive": Make("SchneiderElectric__NEMA23.eds", "schneider-lexium-mdrive"),  # by life guarding
    "Infranor Easy-ak": Make("Easy-ak_v1.30.eds", "infranor", LOST_HOST | {"halt reaction", "fault reaction"}),
    "Roboteq": Make("roboteq_motor_controllers_v2.0-30-01-2019.eds", "roboteq", NO_STOPS),
    "Schunk": Make("canopen_test_utils__config__Schunk_0_63.dcf", "schunk", NO_STOPS),
    "Pilz PRBT": Make("robot_control__prbt_0_1.dcf", "schunk", NO_STOPS),
    "Technosoft ISD860 (two entries a PDO)": Make("ISD860.dcf", "technosoft-ipos", NO_STOPS, tells_load=False),
    "the profile's sample": Make("eds_library__cia__402.eds", "generic", LOST_HOST, tells_load=False),
}
FIXED_PDOS = tuple(
    f"605.3150.{number}-{rest}-60.eds"
    for number, rest in [(51, "V-EK-2"), (52, "V-EK-2"), (60, "B-EK-2"), (66, "B-EK-2"), (71, "A-EK-3")]
)
"""Faulhaber's older firmware: no PDO carries its position; refused"""
NO_PROFILE_POSITION = "ipa_canopen_test__config__Schunk_0_63.dcf"
"""by its 6502, which another file of that drive has otherwise; refused"""


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


def config_of(make: Make, eds: Path, **change: Any) -> WinchConfig:
    return winch_config(eds, read_family(FOLDER / f"{make.family}.toml"), mode=make.mode, **change)


def test_it_walks_from_bring_up_to_power_off(made):
    make, eds = made
    walked = walk(config_of(make, eds))
    assert (walked.stage, walked.problem) == ("power off", "")
    assert {line.requirement.key for line in walked.grades if line.met is Met.TRIAL} == make.by_trial
    assert not [line for line in walked.grades if line.met is Met.ABSENT]
    assert walked.tells_load == make.tells_load


@pytest.mark.parametrize("name", ["Faulhaber MCBL", "Maxon EPOS4", "Nanotec CL4-E"])
def test_what_no_trial_has_proven_is_refused_before_anything_is_written(shared, name):
    make = MAKES[name]
    eds = file_of(make, shared)

    async def walk() -> None:
        async with DriveBench(config_of(make, eds, proofs=())) as bench:
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
        able, grades = by_file(found.dictionary, config_of(Make(path.name, "generic"), path))
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
        assert bool(lacks) == path.name.endswith((*FIXED_PDOS, NO_PROFILE_POSITION)), path.name
    assert (drives, others) == (32, 23)


@pytest.fixture(scope="module")
def counted(shared: Path) -> list[Counted]:
    return [count(path) for path in files_in(folder_of(shared))]


def test_every_drive_of_every_maker_walks_or_is_refused_before_power(counted):
    astray = {one.path.name: one.walked for one in counted if one.walked is not None and not one.whole}
    assert astray == {}
    refused = [one for one in counted if one.family and one.walked is None]
    says = {one.path.name: one.lacks[0] for one in refused}
    mode = says.pop(next(name for name in says if name.endswith(NO_PROFILE_POSITION)))
    assert mode == "6502:0 is 0x62: no profile position (1)"
    assert all(name.endswith(FIXED_PDOS) and "no TPDO carries 6064:0" in lack for name, lack in says.items())


def test_the_page_says_what_they_come_to(counted):
    """docs/rig.md, by `python -m benchmarks.drives ../shared/eds`."""
    said = " ".join(PAGE.read_text(encoding="utf-8").split())
    assert summary(counted) in said


def test_what_the_drive_does_not_guard_the_area_is_smaller_for(shared):
    lexium, roboteq = MAKES["Lexium MDrive"], MAKES["Roboteq"]
    config = config_of(lexium, file_of(lexium, shared), quick_stop_deceleration=2.0, proofs=())
    assert fitted(config).length_limits == pytest.approx((0.3225, 2.9775)), "0.3² / (2 · 2) m from each end"
    weak = TrialPassed(Trial.QUICK_STOP, 0, 0.02, 0.04, 4e-4)  # 0.5 m/s²
    needs = config_of(roboteq, file_of(roboteq, shared), proofs=(weak,))
    assert fitted(needs).max_speed == pytest.approx(0.15), "a quarter of the deceleration, half the speed"
