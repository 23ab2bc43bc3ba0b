"""Whatever a drive's dictionary lacks or keeps to itself: it is refused before it has power, or walks the whole way."""

import asyncio
import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.drives.bench import PROOFS, DriveBench, walk, winch_config
from drivers.cia402.dictionary import GENERIC_EDS, DriveFamily, Load
from drivers.cia402.motion import Cia402Winch
from drivers.cia402.profile import Mode
from drivers.cia402.watch import CanopenMaster
from drivers.ports import DriveState
from sim_backends.jumping_loop import run

SECTIONS = re.compile(r"^\[([0-9A-F]{4})(?:sub([0-9A-F]+))?\]\n(?:(?!\[).*\n?)*", re.MULTILINE)
TEXT = GENERIC_EDS.read_text(encoding="utf-8")
ENTRIES = sorted({f"{found[1]}:{found[2]}" for found in SECTIONS.finditer(TEXT) if found[2]})
OBJECTS = sorted({found[1] for found in SECTIONS.finditer(TEXT)} | {"100C", "100D"})
GUARDED = "".join(
    f"[{index}]\nParameterName=x\nObjectType=7\nDataType={kind}\nAccessType=rw\nPDOMapping=0\n\n"
    for index, kind in (("100C", 6), ("100D", 5))
)
BEGUN = ("simulated", "bring-up")
"""stages without power"""


def spoilt(lacks: set[str], read_only: set[str], fixed: set[str]) -> str:
    """The generic dictionary without some objects; some cannot be written, some cannot be mapped."""

    def one(found: re.Match[str]) -> str:
        section = found[0]
        if found[1] in lacks or f"{found[1]}:{found[2]}" in lacks:
            return ""
        if found[1] in read_only or f"{found[1]}:{found[2]}" in read_only:
            section = re.sub(r"^AccessType=(rw|rww|rwr|wo)$", "AccessType=ro", section, flags=re.MULTILINE)
        return section.replace("PDOMapping=1", "PDOMapping=0") if found[1] in fixed else section

    return SECTIONS.sub(one, TEXT + "\n" + GUARDED)


SOME = st.sets(st.sampled_from([*OBJECTS, *ENTRIES]), max_size=6)


@settings(max_examples=40)
@given(
    lacks=SOME,
    read_only=st.sets(st.sampled_from([*OBJECTS, *ENTRIES]), max_size=3),
    fixed=st.sets(st.sampled_from(OBJECTS), max_size=2),
    load=st.sampled_from([Load.CURRENT, Load.TORQUE]),
    mode=st.sampled_from([Mode.PROFILE_POSITION, Mode.CYCLIC_POSITION]),
    proven=st.booleans(),
)
def test_any_dictionary_is_refused_before_power_or_walks(tmp_path_factory, lacks, read_only, fixed, load, mode, proven):
    path = tmp_path_factory.mktemp("eds") / "drive.eds"
    path.write_text(spoilt(lacks, read_only, fixed), encoding="utf-8")
    proofs = PROOFS if proven else ()
    walked = walk(winch_config(path, DriveFamily(), load=load, mode=mode, proofs=proofs))
    if walked.problem:
        assert walked.stage in BEGUN, walked
        assert "refused, it must not be switched on" in walked.problem or "holds no objects" in walked.problem
    else:
        assert walked.stage == "power off"


@pytest.mark.parametrize("mode", [Mode.PROFILE_POSITION, Mode.CYCLIC_POSITION])
def test_one_that_lacks_nothing_walks(tmp_path, mode):
    path = tmp_path / "drive.eds"
    path.write_text(spoilt(set(), set(), set()), encoding="utf-8")
    assert walk(winch_config(path, DriveFamily(), mode=mode)).stage == "power off"


@pytest.mark.parametrize("lacks", [set(), {"606C"}])
def test_a_drive_that_a_killed_host_has_left_is_taken_over_with_or_without_a_velocity(tmp_path, lacks):
    path = tmp_path / "drive.eds"
    path.write_text(spoilt(lacks, set(), set()), encoding="utf-8")

    async def script():
        async with DriveBench(winch_config(path, DriveFamily())) as bench:
            await bench.winch.configure()
            await bench.winch.enable()
            await bench.winch.move_to(1.5, 0.1, 0.5)
            await bench.clock.sleep(0.5)
            bench.tasks.pop(0).cancel()
            await bench.clock.sleep(1.0)
            master = CanopenMaster(bench.bus, bench.clock)
            winch = Cia402Winch(bench.config, master, takes_over=True)
            bench.tasks.append(asyncio.ensure_future(master.run()))
            await winch.configure()
            return winch.latest()

    sample = run(script())
    assert sample.state is DriveState.QUICK_STOP_ACTIVE
    assert 1.0 < sample.length < 1.1


@pytest.mark.parametrize("objects", [("6081", "6083", "6085", "607F"), ("6078",)])
def test_a_drive_whose_numbers_are_real_ones_walks(tmp_path, objects):
    def real(found: re.Match[str]) -> str:
        return re.sub("DataType=.*", "DataType=0x0008", found[0]) if found[1] in objects else found[0]

    path = tmp_path / "drive.eds"
    path.write_text(SECTIONS.sub(real, TEXT), encoding="utf-8")
    assert walk(winch_config(path, DriveFamily())).stage == "power off"
