"""Drives whose PDOs cannot be mapped, or hold little: used as they are where that suffices, refused with a reason."""

import asyncio
import re
from pathlib import Path

import pytest

from benchmarks.drives.bench import DriveBench, walk, winch_config
from drivers.canbus.transport import CanFrame
from drivers.cia402.dictionary import GENERIC_EDS, DriveFamily
from drivers.cia402.dictionary.fitted import by_file
from drivers.cia402.motion import pull_taut
from drivers.ports import DriveState
from fidim_lab.app.doctor.checks import CheckVerdict
from fidim_lab.app.doctor.drive_doctor import check_eds
from fidim_lab.data.eds import read_dictionary
from fidim_lab.errors import RefusedError
from sim_backends.jumping_loop import run

PDOS = re.compile(r"^\[1[468A]0[0-9A-F](?:sub[0-9A-F]+)?\]\n(?:(?!\[).*\n?)*", re.MULTILINE)
CONTROL, MODE, TARGET, SPEED = 0x60400010, 0x60600008, 0x607A0020, 0x60FF0020
TORQUE, LOAD_32 = 0x60710010, 0x60780020
STATUS, SHOWN, PLACE, VELOCITY, LOAD = 0x60410010, 0x60610008, 0x60640020, 0x606C0020, 0x60780010
OF_CIA_402 = {
    0x1400: [CONTROL],
    0x1401: [CONTROL, MODE],
    0x1402: [CONTROL, TARGET],
    0x1403: [CONTROL, SPEED],
    0x1800: [STATUS],
    0x1801: [STATUS, SHOWN],
    0x1802: [STATUS, PLACE],
    0x1803: [STATUS, VELOCITY],
}
"""the mapping that the profile gives a drive by default"""
APART = {key: entries for key, entries in OF_CIA_402.items() if key >= 0x1800} | {0x1400: [CONTROL]}


def section(index: int, sub: int, kind: int, access: str, value: object) -> str:
    return (
        f"[{index:X}sub{sub:X}]\nParameterName=x\nObjectType=7\nDataType={kind}\nAccessType={access}\n"
        f"DefaultValue={value}\nPDOMapping=0\n\n"
    )


def eds(
    folder: Path,
    pdos: dict[int, list[int]],
    *,
    mapping: str = "ro",
    counted: str = "",
    cob: str = "rw",
    kind: tuple[str, int] = ("rw", 255),
    more: str = "",
    lacks: str = "",
    has: tuple[str, dict[str, str]] = ("", {}),
) -> Path:
    """The generic dictionary with these PDOs; access of mapping, its count, identifiers, transmission types."""
    text = PDOS.sub("", GENERIC_EDS.read_text(encoding="utf-8"))
    if lacks:
        text = re.sub(rf"^\[{lacks}\]\n(?:(?!\[).*\n?)*", "", text, flags=re.MULTILINE)
    for key, value in has[1].items():
        text = re.sub(rf"(^\[{has[0]}\]\n(?:(?!\[).*\n)*?){key}=.*\n", "\\1", text, flags=re.MULTILINE)
        text = text.replace(f"[{has[0]}]\n", f"[{has[0]}]\n{key}={value}\n")
    for index, entries in pdos.items():
        first = 0x180 if index >= 0x1800 else 0x200
        ids = f"$NODEID+0x{first + 0x100 * (index & 3):X}"
        text += section(index, 0, 5, "ro", 2) + section(index, 1, 7, cob, ids) + section(index, 2, 5, *kind)
        text += section(index + 0x200, 0, 5, counted or mapping, sum(map(bool, entries)))
        text += "".join(section(index + 0x200, n, 7, mapping, f"0x{e:X}") for n, e in enumerate(entries, start=1))
    path = folder / "drive.eds"
    path.write_text(text + more, encoding="utf-8")
    return path


WALK = {
    "CiA 402's own": dict(pdos=OF_CIA_402),
    "constants": dict(pdos=OF_CIA_402, mapping="const"),
    "with the load": dict(pdos=OF_CIA_402 | {0x1803: [STATUS, VELOCITY, LOAD]}),
    "with what nobody asked for": dict(pdos=OF_CIA_402 | {0x1803: [0x60FD0020, VELOCITY]}),
    "an RPDO with a place holder": dict(pdos=OF_CIA_402 | {0x1402: [CONTROL, 0x00060010, TARGET]}),
    "one of each, mapped": dict(pdos={0x1400: [0] * 3, 0x1800: [0] * 3}, mapping="rw"),
    "a torque beside the position": dict(pdos=OF_CIA_402 | {0x1402: [CONTROL, TARGET, TORQUE]}),
    "entries that can be written, their count that cannot": dict(
        pdos={0x1400: [0] * 3, 0x1800: [0] * 3, 0x1801: [0] * 3}, mapping="rw", counted="ro"
    ),
    "no 606C": dict(pdos=OF_CIA_402, lacks="606C"),
    "a target in a PDO of its own": dict(pdos=APART | {0x1401: [TARGET]}),
    "a target beside the mode": dict(pdos=APART | {0x1401: [TARGET, MODE]}),
    "RPDOs of one place": dict(pdos=APART | {0x1400: [0], 0x1401: [0], 0x1402: [0]}, mapping="rw"),
    "places that nothing is in": dict(pdos=OF_CIA_402 | {0x1802: [0x00050008, STATUS, 0x00050008, PLACE]}),
    "a mode that it keeps": dict(pdos=OF_CIA_402, has=("6060", {"AccessType": "ro", "DefaultValue": "1"})),
    "a load that is no whole number": dict(
        pdos=OF_CIA_402 | {0x1803: [VELOCITY, LOAD_32]}, has=("6078", {"DataType": "0x0008"})
    ),
}
TELLS_LOAD = (
    "with the load",
    "a load that is no whole number",
    "RPDOs of one place",
    "one of each, mapped",
    "entries that can be written, their count that cannot",
)
TELLS_NO_SPEED = ("one of each, mapped", "no 606C")


@pytest.mark.parametrize("case", WALK)
def test_it_walks_by_what_its_pdos_carry(tmp_path, case):
    path = eds(tmp_path, **WALK[case])
    walked = walk(winch_config(path, DriveFamily()))
    assert (walked.stage, walked.problem) == ("power off", "")
    assert walked.tells_load == (case in TELLS_LOAD)
    [samples] = [line.found for line in walked.grades if line.requirement.key == "samples at each SYNC"]
    assert ("speed by the positions" in samples) == (case in TELLS_NO_SPEED)


def test_slack_is_not_taken_up_where_each_controlword_brings_another_torque(tmp_path):
    path = eds(tmp_path, OF_CIA_402 | {0x1402: [CONTROL, TARGET, TORQUE]})

    async def script() -> None:
        async with DriveBench(winch_config(path, DriveFamily())) as bench:
            await bench.winch.configure()
            await bench.winch.enable()
            with pytest.raises(RefusedError, match="its fixed RPDO has the torque"):
                await pull_taut(bench.winch, 0.5, 0.05, 0.1)

    run(script())


def test_a_mode_that_no_pdo_carries_is_asked_for_while_the_drive_works(tmp_path):
    path = eds(tmp_path, **WALK["one of each, mapped"])

    async def script() -> str:
        async with DriveBench(winch_config(path, DriveFamily())) as bench:
            bench.tasks.append(asyncio.ensure_future(bench.winch.watch_health()))
            await bench.winch.configure()
            await bench.winch.enable()
            await bench.clock.sleep(1.0)
            assert bench.look().fault == ""
            bench.drive.receive(CanFrame(0x605, bytes.fromhex("2f60600003000000"), bench.clock.now()))
            await bench.clock.sleep(0.7)
            return bench.look().fault

    assert run(script()) == "it has changed to profile velocity (3), profile position (1) was commanded"


def test_pdos_that_stay_on_are_left_alone(tmp_path):
    """Identifiers that cannot be written: the drive goes on sending what nobody asked for, and is used all the same."""
    path = eds(tmp_path, OF_CIA_402, cob="ro")
    assert walk(winch_config(path, DriveFamily())).stage == "power off"


REFUSED = {
    "event driven": (
        dict(pdos=OF_CIA_402, kind=("ro", 255)),
        "1800:2, 1801:2, 1802:2, 1803:2: read only and 255, not 1: sent when the drive likes, at rest never",
    ),
    "a position that is no whole number": (
        dict(pdos=OF_CIA_402, has=("6064", {"DataType": "0x0008"})),
        "no TPDO carries 6064:0 (its DataType is not the whole number of 32 bits",
    ),
    "no word of the mapping": (dict(pdos={k: [0] for k in OF_CIA_402}), "1A00, 1A01, 1A02, 1A03: read only, and the"),
    "more than is sent": (
        dict(pdos=OF_CIA_402 | {0x1402: [CONTROL, TARGET, 0x60830010]}),
        "no RPDO carries 6040:0 with 607A:0 (no other of transmission type 255 has places for these",
    ),
    "a position of 16 bits": (dict(pdos=OF_CIA_402 | {0x1802: [STATUS, 0x60640010]}), "no TPDO carries 6064:0"),
    "no PDO": (dict(pdos={}), "it has none of TPDO 1 to 4"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_does_not_suffice_is_refused_with_object_and_cure(tmp_path, case):
    arguments, says = REFUSED[case]
    path = eds(tmp_path, **arguments)
    walked = walk(winch_config(path, DriveFamily()))
    assert walked.stage == "bring-up"
    assert says in walked.problem
    [failed] = [check for check in check_eds(path, None) if check.verdict is CheckVerdict.FAILED]
    assert says in failed.found
    assert "map them with the maker's tool" in failed.advice


def test_a_mapping_other_than_its_files_is_refused(tmp_path):
    path = eds(tmp_path, OF_CIA_402)

    async def script() -> str:
        async with DriveBench(winch_config(path, DriveFamily())) as bench:
            bench.drive.od.fix(0x1A02, 2, 0x60630020)
            try:
                await bench.winch.configure()
            except Exception as error:
                return str(error)
            return ""

    assert "1A02:2 PDO mapping: 0x60630020 found, 0x60640020 wanted" in run(script())


def test_a_file_that_says_of_no_object_that_it_is_mapped_is_not_believed(tmp_path):
    path = tmp_path / "drive.eds"
    path.write_text(GENERIC_EDS.read_text(encoding="utf-8").replace("PDOMapping=1", "PDOMapping=0"), encoding="utf-8")
    found = read_dictionary(path, 5)
    assert any("no object has PDOMapping=1" in repair.what for repair in found.repairs)
    able, _ = by_file(found.dictionary, winch_config(path, DriveFamily()))
    assert able.layout.problem == ""


# units --------------------------------------------------------------------------------------------------------------


def unit(path: Path, told: int) -> Path:
    text = GENERIC_EDS.read_text(encoding="utf-8")
    more = (
        f"\n[60A9]\nParameterName=x\nObjectType=7\nDataType=7\nAccessType=rw\nDefaultValue=0x{told:X}\nPDOMapping=0\n"
    )
    path.write_text(text + more, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("told", "speed", "refused"),
    [
        (0x00B44700, "rpm", ""),
        (0xFDB44700, "rpm", "0.001 rpm found, rpm wanted"),
        (0xFFB44700, "0.1 rpm", ""),
        (0x00B44700, "counts/s", "rpm found, counts/s wanted"),
        (0x00B50300, "counts/s", ""),
        (0x00B40300, "rpm", "turns/s found, rpm wanted"),
        (0, "rpm", ""),
        (0x00C03600, "rpm", ""),
    ],
)
def test_the_unit_of_speeds_that_a_drive_tells_is_its_familys(tmp_path, told, speed, refused):
    path = unit(tmp_path / "drive.eds", told)
    walked = walk(winch_config(path, DriveFamily(speed=speed)))
    assert refused in walked.problem
    assert (walked.stage == "power off") == (not refused)


@pytest.mark.parametrize(("told", "says"), [(0xFDB44700, "60A9 is 0.001 rpm by the file"), (0, "generic CiA 402, for")])
def test_the_doctor_warns_of_a_unit_that_may_be_another(tmp_path, told, says):
    checks = check_eds(unit(tmp_path / "drive.eds", told), None)
    [family] = [check for check in checks if check.name.startswith("family of")]
    assert family.verdict is CheckVerdict.WARNING
    assert says in family.found
    assert "family file" in family.advice


def test_ramps_that_are_times_and_a_velocity_of_its_own(tmp_path):
    """Delta: 6083 is the ms from 0 to 3000 rpm; 60FF goes with 606C, not with 6081."""
    family = DriveFamily(velocity="0.1 rpm", acceleration="ms to 3000 rpm")

    async def script() -> None:
        async with DriveBench(winch_config(GENERIC_EDS, family)) as bench:
            winch, told = bench.winch, bench.drive.od.number
            await winch.configure()
            # 50 turns/s of 4000 counts, at 2 m/s² · 40 000 counts / (2π · 0.03 m)
            assert told(0x6083) == told(0x6085) == 471
            await winch.enable()
            await winch.move_to(1.4, 0.2, 0.5)
            await bench.clock.sleep(0.2)
            assert bench.look().velocity == pytest.approx(0.1, rel=0.1), "0.5 m/s² for 0.2 s"
            await bench.arrive(1.4)
            assert bench.look().state is DriveState.OPERATION_ENABLED

    run(script())


@pytest.mark.parametrize(("low", "high", "refused"), [(0, 0, False), (-(2**31), 2**31 - 1, False), (0, 3599, True)])
def test_a_position_that_begins_anew_within_the_winch_is_refused(tmp_path, low, high, refused):
    path = tmp_path / "drive.eds"
    more = section(0x607B, 0, 5, "ro", 2) + section(0x607B, 1, 4, "rw", low) + section(0x607B, 2, 4, "rw", high)
    path.write_text(GENERIC_EDS.read_text(encoding="utf-8") + more, encoding="utf-8")
    problem = walk(winch_config(path, DriveFamily())).problem
    assert ("607B:1 range of positions" in problem) == refused
