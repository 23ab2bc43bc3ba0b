"""What a drive can do, by dictionary and family: objects, and PDOs as this drive carries them."""

from typing import Any

import canopen
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.cia402.dictionary import GENERIC_EDS, AmpereObject, DriveFamily, Load, Met, WinchConfig
from drivers.cia402.dictionary.abilities import Abilities, abilities
from drivers.cia402.dictionary.grading import grade
from drivers.cia402.dictionary.layout import FRAME
from drivers.cia402.dictionary.registers import Access
from drivers.cia402.dictionary.settings import Setting
from drivers.cia402.profile import Mode
from drivers.cia402.wire.pdo import Mappable, SampleDecoder, mapping_expected, mapping_writes

PDOS = (0x1400, 0x1600, 0x1800, 0x1A00)
I8, I16, I32, U8, U16, U32 = 2, 3, 4, 5, 6, 7


def config(**change: Any) -> WinchConfig:
    usual: dict[str, Any] = {"name": "winch 3", "node_id": 3, "counts_per_turn": 4096.0, "drum_radius": 0.03}
    usual |= {"rated_current": 4.0, "current_limit": 6.0, "max_speed": 0.3, "max_acceleration": 1.0}
    return WinchConfig(**(usual | {"length_limits": (0.3, 3.0)} | change))


def dictionary(places: tuple[int, ...] = (8, 8, 8, 8), **types: int) -> canopen.ObjectDictionary:
    """A drive with PDOs of so many entries; types of objects ("o6078" = INTEGER32), 0 leaves one out."""
    od = canopen.ObjectDictionary()
    kinds = {0x6040: U16, 0x6041: U16, 0x6060: I8, 0x6061: I8, 0x6064: I32, 0x606C: I32, 0x6078: I16, 0x607A: I32}
    kinds |= {int(name[1:], 16): kind for name, kind in types.items()}
    for index, kind in kinds.items():
        if kind:
            add(od, index, 0, kind, mappable=True)
    for number, count in enumerate(places):
        for base in PDOS:
            mapping = base in (0x1600, 0x1A00)
            for sub in range(count + 1 if mapping else 3):
                add(od, base + number, sub, U32 if sub else U8, in_record=True)
    return od


def add(od: Any, index: int, sub: int, kind: int, *, mappable: bool = False, in_record: bool = False) -> Any:
    variable = canopen.objectdictionary.ODVariable(f"{index:04X}:{sub}", index, sub)
    variable.data_type, variable.access_type, variable.pdo_mappable = kind, "rw", mappable
    if not in_record:
        od.add_object(variable)
        return variable
    if index not in od:
        od.add_object(canopen.objectdictionary.ODRecord(f"{index:04X}", index))
    od[index].add_member(variable)
    return variable


def carried(able: Abilities) -> list[list[str]]:
    return [[entry.name for entry in pdo.entries] for pdo in able.layout.pdos]


COMMANDS = ["CONTROLWORD", "MODE", "TARGET_POSITION"]
LAYOUTS = {
    "all free": (
        dictionary(),
        config(),
        [
            ["STATUSWORD", "POSITION", "MODE_DISPLAY"],
            ["VELOCITY", "CURRENT"],
            ["CONTROLWORD", "MODE", "TARGET_POSITION"],
        ],
    ),
    "two entries a PDO": (
        dictionary((1, 2, 2, 2)),
        config(),
        [["STATUSWORD"], ["POSITION", "MODE_DISPLAY"], ["VELOCITY", "CURRENT"], ["CONTROLWORD", "TARGET_POSITION"]],
    ),
    "one entry a PDO": (
        dictionary((1, 1, 1, 1)),
        config(),
        [["STATUSWORD"], ["POSITION"], ["VELOCITY"], ["CURRENT"], ["CONTROLWORD"], ["TARGET_POSITION"]],
    ),
    "32 bits of current": (
        dictionary(o6078=I32),
        config(),
        [
            ["STATUSWORD", "POSITION", "MODE_DISPLAY"],
            ["VELOCITY", "CURRENT"],
            ["CONTROLWORD", "MODE", "TARGET_POSITION"],
        ],
    ),
    "no mode in a PDO": (
        dictionary(o6060=0, o6061=0),
        config(),
        [["STATUSWORD", "POSITION", "CURRENT"], ["VELOCITY"], ["CONTROLWORD", "TARGET_POSITION"]],
    ),
    "no load": (
        dictionary(o6078=0),
        config(),
        [["STATUSWORD", "POSITION", "MODE_DISPLAY"], ["VELOCITY"], COMMANDS],
    ),
    "one PDO of each, and the load before the mode": (
        dictionary((8,)),
        config(),
        [["STATUSWORD", "POSITION", "CURRENT"], ["CONTROLWORD", "MODE", "TARGET_POSITION"]],
    ),
    "two entries in all": (
        dictionary((2,)),
        config(),
        [["STATUSWORD", "POSITION"], ["CONTROLWORD", "TARGET_POSITION"]],
    ),
    "cyclic": (
        dictionary((8, 8)),
        config(mode=Mode.CYCLIC_POSITION),
        [
            *(["STATUSWORD", "POSITION", "MODE_DISPLAY"], ["VELOCITY", "CURRENT"]),
            *(["CONTROLWORD", "MODE", "TARGET_POSITION"], ["TARGET_POSITION"]),
        ],
    ),
}


@pytest.mark.parametrize("case", LAYOUTS)
def test_pdos_are_packed_as_the_drive_carries_them(case):
    od, winch, wanted = LAYOUTS[case]
    able = abilities(od, winch)
    assert able.layout.problem == ""
    assert carried(able) == wanted


PROBLEMS = {
    "no TPDO": (
        dictionary(()),
        "no TPDO carries 6041:0, no TPDO carries 6064:0 (it has none of TPDO 1 to 4); no RPDO carries 6040:0 with 607A",
    ),
    "a position of 16 bits": (dictionary(o6064=I16), "no TPDO carries 6064:0 (its DataType is not the whole number"),
    "no target": (dictionary(o607A=0), "no RPDO carries 607A:0 (there is no such object)"),
    "too few": (dictionary((1,)), "no TPDO carries 6064:0 (no place is left)"),
}


@pytest.mark.parametrize("case", PROBLEMS)
def test_what_cannot_be_carried_is_named(case):
    od, says = PROBLEMS[case]
    assert abilities(od, config()).layout.problem.startswith(says)


def test_what_cannot_be_carried_is_named_once_and_never_without_a_name():
    od = dictionary(o607A=I16)
    problem = abilities(od, config(mode=Mode.CYCLIC_POSITION)).layout.problem
    assert problem.count("607A") == 1
    assert "carries  (" not in problem


@pytest.mark.parametrize(
    ("identifier", "says"),
    [(0x80000183, "read only, and switched off"), (0x1FF, "read only, and another identifier than the standard's")],
)
def test_a_pdo_whose_identifier_cannot_be_written_is_refused_for_what_it_is(identifier, says):
    od = dictionary((8,))
    od[0x1800][1].access_type, od[0x1800][1].default = "ro", identifier
    assert f"1800:1: {says}" in abilities(od, config()).layout.problem


MODES = {
    "no ramps, but cyclic": ({"6060:0", "6061:0", "60C2:1", "60C2:2"}, None, "", 'set mode = "cyclic-position"'),
    "6502 without profile position": (
        {"6060:0", "6061:0", "6081:0", "6083:0", "60C2:1", "60C2:2"},
        0x80,
        "6502:0 is 0x80: no profile position (1)",
        'it has cyclic position (8): set mode = "cyclic-position"',
    ),
    "neither": ({"6060:0", "6061:0"}, None, "no 6081:0 and no 6083:0", ""),
    "60C2, but not by 6502": ({"6060:0", "6061:0", "60C2:1", "60C2:2"}, 0x01, "no 6081:0 and no 6083:0", ""),
    "a mode that cannot be chosen": ({"6061:0", "60C2:1", "60C2:2"}, None, "no 6060:0", ""),
}


@pytest.mark.parametrize("case", MODES)
def test_a_drive_without_the_mode_of_the_rig_file_is_refused_with_the_mode_that_it_has(case):
    objects, modes, says, cure = MODES[case]
    od = dictionary(o6060=0, o6061=0)
    for name in objects:
        index, sub = (int(part, 16) for part in name.split(":"))
        add(od, index, sub, I8, in_record=sub > 0)
    told = {} if modes is None else {"6502:0": modes}
    table = grade(abilities(od, config()), config(), told, 0)
    line = next(line for line in table if line.requirement.key == "position command")
    assert line.met is Met.ABSENT
    assert says in line.found
    assert line.found.endswith(cure)
    assert cure or "set mode" not in line.found


def test_a_drive_without_load_objects_is_told_where_to_name_its_own():
    table = grade(abilities(dictionary(o6078=0), config()), config(), {}, 0)
    load = next(line for line in table if line.requirement.key == "load reported")
    assert load.found.endswith("name the object that holds its current in a family file (load)")


@given(st.lists(st.integers(0, 8), max_size=4), st.sampled_from([0, I16, I32]), st.sampled_from([0, I8]))
def test_any_drive_has_a_layout_that_fits_or_a_problem(places, current, display):
    able = abilities(dictionary(tuple(places), o6078=current, o6061=display), config())
    layout = able.layout
    if layout.problem:
        return
    told = [entry.name for pdo in layout.tpdos for entry in pdo.entries]
    assert len(told) == len(set(told))
    assert {"STATUSWORD", "POSITION"} <= set(told)
    for pdo in layout.pdos:
        assert pdo.format.size <= FRAME
        assert len(pdo.entries) <= places[pdo.number - 1]
    decoder = SampleDecoder(layout.tpdos)
    values = [decoder.feed(n, bytes(pdo.format.size), 1.0) for n, pdo in enumerate(layout.tpdos)][-1]
    assert values is not None
    assert (values.current == 0.0) == (current != 0 and "CURRENT" in told)


def test_a_transmission_type_that_cannot_be_written_is_only_compared():
    od = dictionary((8, 8, 8))
    od[0x1400][2].access_type, od[0x1400][2].default = "ro", 255
    od[0x1800][2].access_type, od[0x1800][2].default = "ro", 255
    able = abilities(od, config())
    assert [pdo.number for pdo in able.layout.tpdos] == [2, 3], "TPDO 1 is not sent at SYNC"
    rpdo = able.layout.rpdo
    assert (0x1400, 2) not in {(o.index, o.sub) for o in mapping_writes(rpdo, 3)}
    assert (0x1400, 2) in {(o.index, o.sub) for o in mapping_expected(rpdo, 3)}


def test_a_family_takes_away_and_shows():
    family = DriveFamily(
        absent={"6084:0": "x"},
        read_only={"6083:0": "x"},
        not_mappable={"6061:0": "x"},
        load_object=AmpereObject(index=0x2027, ampere=0.001),
    )
    od = canopen.import_od(str(GENERIC_EDS), 3)
    add(od, 0x2027, 0, I32, mappable=True)
    able = abilities(od, config(family=family, load=Load.VENDOR))
    assert [able.access(index) for index in (0x6084, 0x6083, 0x6085)] == [Access.ABSENT, Access.READ, Access.WRITE]
    wanted = [Setting(index, 0, 1, "x") for index in (0x6083, 0x6084, 0x6085)]
    assert [s.index for s in able.fitting(wanted)] == [0x6085]
    assert [s.index for s in able.kept(wanted)] == [0x6083]
    assert not able.layout.tells(Mappable.MODE_DISPLAY.name)
    assert [f"{e.mapping:08X}" for pdo in able.layout.tpdos for e in pdo.entries] == [
        *("60410010", "60640020", "606C0020", "20270020")
    ]


@pytest.mark.parametrize(("value", "met"), [(2, Met.CONFIGURED), (0, Met.ABSENT), (None, Met.ABSENT)])
def test_a_reaction_that_is_read_only_counts_where_it_stops(value, met):
    family = DriveFamily(read_only={"605E:0": "x"})
    winch = config(family=family)
    able = abilities(canopen.import_od(str(GENERIC_EDS), 3), winch)
    told = {} if value is None else {"605E:0": value}
    table = {line.requirement.key: line for line in grade(able, winch, told, 0)}
    assert table["fault reaction"].met is met
    assert all(line.met is Met.CONFIGURED for key, line in table.items() if key not in ("fault reaction", "jerk limit"))


def test_cyclic_mode_needs_the_interpolation_period():
    family = DriveFamily(absent={"60C2:1": "x"})
    winch = config(family=family, mode=Mode.CYCLIC_POSITION)
    for one, met in ((winch, Met.ABSENT), (winch.changed(mode=Mode.PROFILE_POSITION), Met.CONFIGURED)):
        able = abilities(canopen.import_od(str(GENERIC_EDS), 3), one)
        [line] = [line for line in grade(able, one, {}, 0) if line.requirement.key == "position command"]
        assert line.met is met
