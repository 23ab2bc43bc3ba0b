"""Rig files: every example reads, what is wrong is named by file, table, key, found and allowed."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fidim_lab.app.compose import require_what_winches_do, rig_settings
from fidim_lab.app.formats.run_spec import overridden
from fidim_lab.data.rigs.rig_file import read_rig
from fidim_lab.data.rigs.rig_guard_tables import SlipGuardTable
from fidim_lab.data.rigs.rig_tables import MocapKind
from fidim_lab.errors import FileError, SetupError
from procedures.settings import Reaction

EXAMPLES = sorted((Path(__file__).parents[3] / "examples" / "rigs").glob("*.toml"))
SIMULATED = next(path for path in EXAMPLES if path.name == "simulated.toml")


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_every_example_is_read(path):
    rig = read_rig(path)
    assert len(rig.winches) == rig.robot.n == 4
    assert sorted({winch.node_id for winch in rig.winches}) == [1, 2, 3, 4]
    entry = rig.motion_capture
    body = entry.kind is MocapKind.VICON_UDP and entry.subject is not None
    assert len(entry.markers) == (0 if body else len(rig.robot.markers))


def test_there_is_an_example_for_each_source_that_is_read():
    kinds = {read_rig(path).motion_capture.kind for path in EXAMPLES}
    assert kinds == set(MocapKind)


def test_every_winch_gives_what_a_winch_does_not_say(changed):
    rig = read_rig(changed('name = "winch 3"', 'name = "winch 3"\nmax_speed = 0.25'))
    assert [winch.max_speed for winch in rig.winches] == [0.5, 0.5, 0.25, 0.5]
    assert [winch.direction for winch in rig.winches] == [1, -1, 1, -1]


def test_a_measured_gain_takes_the_place_of_drum_and_gear(changed):
    rig = read_rig(changed('name = "winch 2"', 'name = "winch 2"\ntension = { gain = 30.0, offset = 1.0 }'))
    assert rig.robot.winches is not None
    assert [winch.newton_per_ampere for winch in rig.robot.winches] == pytest.approx([34.0, 30.0, 34.0, 34.0])


def test_guards_have_defaults_and_take_what_is_said(changed):
    rig = read_rig(changed('[guards.marker]\nreaction = "hold"', '[guards.marker]\nreaction = "reject-window"'))
    assert rig.guards.marker.reaction == "reject-window"
    assert rig.guards.slip == SlipGuardTable(reaction="hold", allowed=0.005)


def test_a_guard_of_what_only_spoils_a_record_may_warn(changed):
    rig = read_rig(changed('[guards.marker]\nreaction = "hold"', '[guards.marker]\nreaction = "warn"'))
    settings = rig_settings(rig)
    assert settings.guard.reactions["marker"] is Reaction.WARN
    assert settings.guard.reactions["clock step"] is Reaction.WARN
    assert settings.guard.reactions["disk"] is Reaction.HOLD
    assert (settings.guard.loop_late, settings.guard.disk_spare) == (1.0, 200e6)


@pytest.mark.parametrize("key", ["motion.speed", "excite.acceleration", "align.speed"])
def test_more_than_the_winches_do_is_refused_before_anything_moves(key):
    rig = read_rig(SIMULATED)
    settings = rig_settings(rig)
    require_what_winches_do(rig, settings)
    with pytest.raises(SetupError, match=rf"{key} is 9 m/s²?; .*simulated\.toml allows its winches"):
        require_what_winches_do(rig, overridden(settings, {key: 9.0}))


def test_a_following_error_that_only_the_drive_would_see_is_refused():
    rig = read_rig(SIMULATED)
    settings, window = rig_settings(rig), min(winch.following_error for winch in rig.winches)
    require_what_winches_do(rig, overridden(settings, {"guard.following_error": window}))
    with pytest.raises(SetupError, match=rf"guard\.following_error is 1 m; .* gives up at {window:g} m by itself"):
        require_what_winches_do(rig, overridden(settings, {"guard.following_error": 1.0}))


@pytest.fixture
def changed(tmp_path):
    """The simulated example with one text replaced by another."""

    def change(old, new):
        text = SIMULATED.read_text()
        assert old in text
        path = tmp_path / "rig.toml"
        path.write_text(text.replace(old, new, 1))
        return path

    return change


HAND = "[simulated_hand]"
RELEASE = """[release]
port = "serial/release"
hold = "ON\\r"
release = "\\u00A0\\u0001"
ask = "?\\r"
holds = "COIL 1"
released = "COIL 0"
"""
CELLS = """[[load_cells]]
port = "/dev/ttyUSB1"
pattern = "{1};{2};{4} kg"
unit = "kg"
rate = 50.0
offset = 0.5
[[load_cells]]
port = "COM3"
pattern = "ST,{*},{3} N"
unit = "N"
rate = 10.0
[inclinometer]
port = "socket://10.0.0.5:4001"
pattern = "{x},{y}"
unit = "deg"
rate = 20.0
ask = "READ\\n"
"""

WRONG = {
    "format": (
        '"fidim-rig/1"',
        '"fidim-rig/9"',
        "rig.toml: format: is 'fidim-rig/9'; this version reads \"fidim-rig/1\"",
    ),
    "unknown key": (
        "interface =",
        "baud = 1\ninterface =",
        "bus, baud: unknown key; allowed are interface, channel, bitrate, sync_rate, heartbeat, host_id, options",
    ),
    "unknown key for all": (
        "gear_ratio =",
        "gear_ration =",
        "winch 1, gear_ration: unknown key; the nearest is gear_ratio (the same in 3 more)",
    ),
    "unknown table": (HAND, f"[relase]\nport = 'x'\n{HAND}", "relase: unknown key; the nearest is release"),
    "unknown key of a cell": (
        HAND,
        CELLS.replace("unit =", "units =") + HAND,
        "units: unknown key; the nearest is unit",
    ),
    "interface": (
        '"slcan"',
        '"slcn"',
        "bus, interface: 'slcn' is not an interface of python-can; the nearest is 'slcan'",
    ),
    "no such interface": (
        '"slcan"',
        '"?"',
        "bus, interface: '?' is not an interface of python-can. It has canalystii, ",
    ),
    "missing for all": ("drum_radius = 0.03 ", "", "winch 1, drum_radius: is missing (the same in 3 more)"),
    "range": ("sync_rate = 100.0", "sync_rate = 1000.0", "bus, sync_rate: 1000; at most 500 is allowed"),
    "order": (
        "[0.3, 3.5]",
        "[3.5, 0.3]",
        "length_limits: the shortest, 3.5 m, is not below the longest, 0.3 m",
    ),
    "node twice": ("node_id = 2", "node_id = 1", "winch 2, node_id: 1 is taken by another winch"),
    "host": ("node_id = 2", "node_id = 126\n[bus.x]", "bus, x: unknown key"),
    "host is a winch": ("sync_rate =", "host_id = 4\nsync_rate =", "bus, host_id: 4 is a winch's node_id"),
    "robot": ('"irma4"', '"none.toml"', "none.toml: no such file. The key robot of rig.toml names it."),
    "robot a device": ('"irma4"', '"/dev/zero"', "is a device, a file was expected. The key robot of rig.toml"),
    "robot no TOML": ('"irma4"', '"/proc/self/limits"', "/proc/self/limits: is not TOML: "),
    "eds a device": ('eds = "generic"', 'eds = "/dev/zero"', "eds: '/dev/zero': is a device, a file was expected;"),
    "eds a folder": ('eds = "generic"', 'eds = "/proc"', "eds: '/proc': is a folder, a file was expected;"),
    "eds": (
        'eds = "generic"',
        'eds = "mine.eds"',
        "winch 1, eds: 'mine.eds': no such file; \"generic\" is the built-in one",
    ),
    "drum": (
        "drum_radius = 0.03 ",
        "drum_radius = 0.04 ",
        "winch 1, drum_radius: 0.04 m, but irma4 says 0.03 m",
    ),
    "natnet's names": (
        '"vicon-udp"',
        '"natnet"',
        'motion_capture: markers: natnet needs "ASSET/NUMBER" of each, as ["1/1"]',
    ),
    "no such source": ('"vicon-udp"', '"kinect"', 'motion_capture, kind: "kinect"; allowed are "'),
    "markers": ('["marker1"]', '["a", "b"]', "motion_capture, markers: 2 names for the 1 marker(s) of the robot file"),
    "coasting": (
        "gear_ratio =",
        "stop = { connection_lost = 0 }\ngear_ratio =",
        "winch 1, stop, connection_lost: 0; allowed is 3",
    ),
    "guard": ("slack = 0.1", "slak = 0.1", "guards, tension, slak: unknown key; the nearest is slack"),
    "reaction": (
        'reaction = "quick-stop"\nslack',
        'reaction = "warn"\nslack',
        'reaction: "warn"; allowed are "hold" or "quick-stop"',
    ),
    "release incomplete": (HAND, f"[release]\nport = 'x'\n{HAND}", "release, hold: is missing"),
    "release commands": (HAND, RELEASE.replace("?", "ON") + HAND, "hold, release, ask: are not three different"),
    "release answers": (HAND, RELEASE.replace("COIL 1", "COIL 0") + HAND, "holds, released: the answers must differ"),
    "release watchdog": (HAND, RELEASE + f"watchdog = 0.2\n{HAND}", "watchdog: 0.2 s, must be at least three periods"),
    "release letters": (HAND, RELEASE.replace("?", "€") + HAND, "a letter beyond one byte"),
    "cell of no cable": (HAND, CELLS.replace("{4}", "{7}") + HAND, "load_cells, pattern: {7} in"),
    "cable with two cells": (HAND, CELLS.replace("{3}", "{1}") + HAND, "there are {3}"),
    "cells without numbers": (HAND, CELLS.replace("{3}", "") + HAND, "names no number, such as {3}"),
    "cells' unit": (HAND, CELLS.replace('"kg"', '"stone"') + HAND, 'load_cells 1, unit: "stone"; allowed are "'),
    "cells too slow": (HAND, CELLS.replace("10.0\n", "1.0\n") + HAND, "age: 0.5 s, must be at least 2 s"),
    "one axis": (HAND, CELLS.replace("{x},", "") + HAND, "inclinometer, pattern: '{y}' must name {x} and {y}"),
}


def test_serial_devices_are_si(changed):
    file = read_rig(changed(HAND, RELEASE + CELLS + HAND))
    assert file.release is not None
    assert (file.release.hold, file.release.release, file.release.ask) == (b"ON\r", b"\xa0\x01", b"?\r")
    assert (file.release.holds, file.release.released, file.release.baud) == ("COIL 1", "COIL 0", 9600)
    assert file.release.port == str(file.path.parent / "serial/release")
    one, two, tilt = file.gauges
    assert one.columns == {"1": "f1", "2": "f2", "4": "f4"}
    assert (one.scale, one.offset, one.port) == (9.80665, 0.5, "/dev/ttyUSB1")
    assert (two.columns, two.port, two.scale) == ({"3": "f3"}, "COM3", 1.0)
    assert tilt.columns == {"x": "incl_x", "y": "incl_y"}
    assert tilt.scale == pytest.approx(0.0174533, rel=1e-5)
    assert (tilt.ask, tilt.port) == (b"READ\n", "socket://10.0.0.5:4001")


def test_one_table_of_load_cells_will_do(changed):
    single = CELLS[: CELLS.index("[[load_cells]]", 5)].replace("[[load_cells]]", "[load_cells]")
    (cells,) = read_rig(changed(HAND, single + HAND)).gauges
    assert list(cells.columns.values()) == ["f1", "f2", "f4"]


@pytest.mark.parametrize("case", WRONG)
def test_a_mistake_is_named(changed, case):
    old, new, says = WRONG[case]
    with pytest.raises(FileError) as caught:
        read_rig(changed(old, new))
    assert says in str(caught.value)
    if case != "robot":
        assert "rig.toml" in str(caught.value)


def test_python_can_is_not_asked_where_the_bus_will_not_be_opened(changed):
    assert read_rig(changed('"slcan"', '"?"'), opened=False).bus.interface == "?"


def test_all_mistakes_at_once(changed, tmp_path):
    path = changed("gear_ratio = 10.0", "gear_ratio = -1.0")
    path.write_text(path.read_text().replace("rate = 100.0    ", "rate = 0.0    "))
    with pytest.raises(FileError) as caught:
        read_rig(path)
    assert "winch 1, gear_ratio" in str(caught.value)
    assert "motion_capture, rate" in str(caught.value)


@given(st.binary(max_size=200))
def test_any_bytes_are_a_file_error_or_a_rig(tmp_path_factory, data):
    path = tmp_path_factory.getbasetemp() / "any-rig.toml"
    path.write_bytes(b'format = "fidim-rig/1"\n' + data)
    with pytest.raises(FileError):
        read_rig(path)


def test_all_that_does_not_fit_what_the_file_names_is_told_in_one_round(tmp_path):
    text = (Path(__file__).parents[3] / "examples" / "rigs" / "simulated.toml").read_text()
    text = text.replace('interface = "slcan"', 'interface = "slcann"').replace('eds = "generic"', 'eds = "none.eds"')
    text = text.replace("drum_radius = 0.03 ", "drum_radius = 0.05 ").replace('["marker1"]', '["marker1", "marker2"]')
    path = tmp_path / "rig.toml"
    path.write_text(text)
    with pytest.raises(FileError) as caught:
        read_rig(path)
    said = str(caught.value)
    for wrong in (
        "bus, interface: 'slcann'",
        "winch 1, eds: 'none.eds'",
        "winch 1, drum_radius: 0.05 m",
        "2 names for",
    ):
        assert wrong in said
    assert said.count("(the same in 3 more)") == 2


def test_winches_alike_are_told_all_at_once(tmp_path):
    text = (Path(__file__).parents[3] / "examples" / "rigs" / "simulated.toml").read_text()
    path = tmp_path / "rig.toml"
    path.write_text(text.replace("node_id = 2", "node_id = 1").replace('name = "winch 4"', 'name = "winch 3"'))
    with pytest.raises(FileError) as caught:
        read_rig(path)
    assert "winch 4, name: 'winch 3'" in str(caught.value)
    assert "winch 2, node_id: 1 is taken" in str(caught.value)
