"""Drive families as data: those that come with us, one of a laboratory's own, and mistakes in them."""

import contextlib
from typing import Any

import canopen
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.cia402.dictionary import GENERIC_EDS, Load, WinchConfig, family_path, read_family
from drivers.cia402.dictionary.family import FOLDER, GENERIC_FAMILY, built_in, families_of
from drivers.cia402.dictionary.layout import used_pdos
from drivers.cia402.dictionary.settings import identity, limits
from drivers.cia402.motion.moves import make_sample, profile
from drivers.cia402.watch.health import NOTHING_TOLD
from drivers.cia402.wire.pdo import DriveValues
from drivers.ports import DriveState
from fidim_lab.errors import FileError

EPOS2 = read_family(FOLDER / "maxon-epos2.toml")


def winch(**change: Any) -> WinchConfig:
    usual: dict[str, Any] = {
        "name": "winch 1",
        "node_id": 1,
        "counts_per_turn": 20_000.0,  # of the drum: gear 10
        "motor_counts": 2_000.0,
        "drum_radius": 0.05 / 3.141592653589793,  # a turn of the drum is 0.1 m
        "rated_current": 4.0,
        "current_limit": 6.0,
        "max_speed": 0.3,
        "max_acceleration": 1.0,
        "length_limits": (0.3, 3.0),
        "home_length": 1.0,
    }
    return WinchConfig(**(usual | change))


def wanted(config: WinchConfig) -> dict[str, int]:
    return {s.object: s.wanted for s in (*identity(config, (0, 0)), *limits(config, 127), *profile(config, 0.1, 0.5))}


def test_generic_is_what_the_profile_says():
    assert read_family(FOLDER / "generic.toml") == GENERIC_FAMILY
    objects = wanted(winch())
    assert objects["607F:0"] == 60_000  # 0.3 m/s · 200 000 counts/m
    assert objects["6081:0"] == 20_000
    assert objects["6073:0"] == 1500
    assert "6410:2" not in objects


def test_all_that_come_with_us_are_read():
    assert {"generic", "technosoft-ipos", "maxon-epos2"} <= set(built_in())
    for name in built_in():
        assert read_family(FOLDER / f"{name}.toml").name
    assert read_family(FOLDER / "technosoft-ipos.toml").load == "torque"


def test_copley_speaks_of_tenths_and_tens_of_counts():
    objects = wanted(winch(family=read_family(FOLDER / "copley.toml")))
    assert (objects["6081:0"], objects["607F:0"]) == (200_000, 600_000)
    assert objects["6083:0"] == 10_000  # 0.5 m/s² · 200 000 counts/m


@pytest.mark.parametrize(
    ("vendor", "families"),
    [
        ("maxon motor ag", ("maxon-epos2", "maxon-epos4")),
        ("Pilz GmbH & Co. KG", ("schunk",)),
        ("Copley Controls Corp.", ("copley",)),
        ("Delta Electronics, Inc.", ("delta-asda",)),
        ("Somebody", ()),
        ("", ()),
    ],
)
def test_a_makers_families_are_found_by_its_name(vendor, families):
    assert families_of(vendor) == families


def test_epos2_speaks_of_rpm_and_milliamperes():
    config = winch(family=EPOS2, load=Load.VENDOR)
    objects = wanted(config)
    assert objects["607F:0"] == 1800  # 0.3 m/s are 3 turns of the drum, 30 of the motor a second
    assert objects["6083:0"] == 3000
    assert objects["6410:2"] == 6000
    assert not set(EPOS2.absent) & set(objects)
    mapped = [[f"{entry.mapping:08X}" for entry in pdo.entries] for pdo in used_pdos(config)]
    assert mapped[1] == ["606C0020", "20270010"]
    values = DriveValues(0.0, 0x27, 200_000, 1, -600, -1500)
    sample = make_sample(values, config, config.scale, DriveState.OPERATION_ENABLED, NOTHING_TOLD)
    assert sample.velocity == pytest.approx(-0.1)  # 600 rpm of the motor, one turn of the drum a second
    assert sample.current == pytest.approx(1.5)
    assert sample.length == pytest.approx(2.0)


def test_our_eds_has_what_a_generic_drive_is_asked():
    dictionary = canopen.import_od(str(GENERIC_EDS), 1)
    for name in wanted(winch()):
        index, sub = (int(part, 16) for part in name.split(":"))
        assert dictionary.get_variable(index, sub) is not None, name


GOOD = 'format = "fidim-drive-family/1"\nname = "ours"\n'
WRONG = {
    "format": ('format = "other/1"', "format: is 'other/1'"),
    "key": (f"{GOOD}sped = 'rpm'", "sped: unknown key"),
    "speed": (f"{GOOD}speed = 'knots'", "speed: 'knots'; there are"),
    "load": (f"{GOOD}load = 'weight'", 'load: "weight"; allowed are "current" or "torque"'),
    "load object": (
        f"{GOOD}load = {{ index = 0x1000, ampere = 1.0 }}",
        "load_object, index: 4096; at least 8192 is allowed",
    ),
    "ampere": (f"{GOOD}load = {{ index = 0x2000, ampere = 0 }}", "load_object, ampere: 0; more than 0 is allowed"),
    "limit": (f"{GOOD}current_limit = 3", "current_limit: 3; a table"),
    "absent": (f'{GOOD}absent = {{ "6072:0" = "" }}', 'absent, 6072:0: the text ""; it must have at least 1 character'),
    "unit": (f"{GOOD}acceleration = '0 turns/s'", "acceleration: '0 turns/s'; there are"),
    "mode shown": (f"{GOOD}mode_shown = 'never'", 'mode_shown: "never"; allowed are "always" or "enabled"'),
    "no unit": (f"{GOOD}velocity = 3", "velocity: 3; a text is wanted"),
    "no TOML": ("= 3", "is not TOML"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_mistake_is_named(tmp_path, case):
    text, says = WRONG[case]
    (tmp_path / "ours.toml").write_text(text)
    with pytest.raises(FileError) as caught:
        read_family(family_path("ours.toml", tmp_path))
    assert says in str(caught.value)


def test_an_unknown_name_lists_those_that_there_are(tmp_path):
    with pytest.raises(
        FileError,
        match="Built in are copley, delta-asda, elmo-gold, faulhaber, generic, infranor, maxon-epos2, maxon-epos4",
    ):
        read_family(family_path("brand-x", tmp_path))


@given(st.text(max_size=200))
def test_any_text_is_a_family_or_a_file_error(tmp_path_factory, text):
    path = tmp_path_factory.mktemp("family") / "any.toml"
    path.write_text(text, encoding="utf-8")
    with contextlib.suppress(FileError):
        assert read_family(path).name
