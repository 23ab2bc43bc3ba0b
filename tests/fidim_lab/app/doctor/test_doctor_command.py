"""`fidim doctor`: exit codes, the table, the JSON, and a check that fails."""

import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from drivers.cia402.dictionary import GENERIC_EDS
from drivers.cia402.dictionary.requirements import REQUIREMENTS
from fidim_lab.app import cli
from fidim_lab.app.doctor import command as doctor
from fidim_lab.app.doctor import permissions_doctor
from fidim_lab.app.doctor.checks import Check, CheckVerdict
from fidim_lab.data.records import Limits
from fidim_lab.data.robot_file import write_robot


def _read(path: Path) -> dict[str, dict[str, str]]:
    table = json.loads(path.read_text())
    assert table["format"] == "fidim-doctor/1"
    return {check["name"]: check for check in table["checks"]}


@pytest.fixture
def well(monkeypatch):
    """A machine on which nothing is wrong, whatever this one is."""
    checks = [
        lambda: Check("Python", CheckVerdict.OK, "3.11"),
        lambda: Check("CAN", CheckVerdict.WARNING, "none", "not needed"),
    ]
    monkeypatch.setattr(doctor, "CHECKS", checks)


def test_every_check_of_this_machine_gives_a_verdict_and_advice_where_it_fails(tmp_path, capsys):
    code = cli.run(["doctor", "--json", str(tmp_path / "d.json")])
    checks = _read(tmp_path / "d.json")
    assert list(checks) == ["Python", "libraries", "package names", "permissions", "CAN", "UDP", "clock", "disk"]
    assert code == int(any(check["verdict"] == "failed" for check in checks.values()))
    for check in checks.values():
        assert check["found"]
        assert bool(check["advice"]) == (check["verdict"] != "ok")
    shown = capsys.readouterr().out
    assert all(name in shown for name in checks)


@pytest.mark.usefixtures("well")
def test_warnings_do_not_fail(capsys):
    assert cli.run(["doctor"]) == 0
    assert "All well." in capsys.readouterr().out


@pytest.mark.usefixtures("well")
def test_a_failed_check_ends_with_1_and_is_named(monkeypatch, capsys):
    failing = [*doctor.CHECKS, lambda: Check("disk", CheckVerdict.FAILED, "no room", "make room")]
    monkeypatch.setattr(doctor, "CHECKS", failing)
    assert cli.run(["doctor"]) == 1
    shown = capsys.readouterr().out
    assert "1 of 3 checks failed: disk" in shown
    assert "make room" in shown


def test_a_stranger_in_our_name_is_found(monkeypatch):
    monkeypatch.setattr(doctor, "packages_distributions", lambda: {"drivers": ["fidim-lab", "windriver"]})
    check = doctor.check_package_names()
    assert check.verdict is CheckVerdict.FAILED
    assert "drivers (from windriver)" in check.found


def test_a_missing_library_is_named(monkeypatch):
    monkeypatch.setattr(doctor, "LIBRARIES", ("numpy", "no-such-library"))
    check = doctor.check_libraries()
    assert (check.verdict, check.found) == (CheckVerdict.FAILED, "without no-such-library")


def _port(tmp_path, monkeypatch, *, open_: bool, group: str):
    port = tmp_path / "ttyUSB0"
    port.touch()
    monkeypatch.setenv("FIDIM_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setattr(permissions_doctor, "comports", lambda: [SimpleNamespace(device=str(port))])
    monkeypatch.setattr(permissions_doctor.os, "access", lambda path, mode: open_)
    monkeypatch.setattr(Path, "group", lambda self: group)
    return permissions_doctor.check_permissions()


def test_a_serial_port_that_is_closed_names_the_group_that_opens_it(tmp_path, monkeypatch):
    check = _port(tmp_path, monkeypatch, open_=False, group="dialout")
    assert check.verdict is CheckVerdict.WARNING
    assert "ttyUSB0 cannot be opened by you" in check.found
    assert "sudo usermod -aG dialout $USER, then log in again" in check.advice


def test_a_port_of_root_is_for_the_administrator(tmp_path, monkeypatch):
    check = _port(tmp_path, monkeypatch, open_=False, group="root")
    assert "administrator" in check.advice
    assert "usermod" not in check.advice


def test_an_open_port_is_named(tmp_path, monkeypatch):
    check = _port(tmp_path, monkeypatch, open_=True, group="dialout")
    assert check.verdict is CheckVerdict.OK
    assert "ttyUSB0" in check.found


def test_a_folder_for_sockets_that_is_open_to_others_or_impossible_fails(tmp_path, monkeypatch):
    monkeypatch.setenv("FIDIM_RUNTIME_DIR", str(tmp_path / "runtime"))
    (tmp_path / "runtime").mkdir(mode=0o755)
    open_to_all = permissions_doctor.check_permissions()
    assert open_to_all.verdict is CheckVerdict.FAILED
    assert "must belong to you alone" in open_to_all.found
    (tmp_path / "file").touch()
    monkeypatch.setenv("FIDIM_RUNTIME_DIR", str(tmp_path / "file" / "runtime"))
    impossible = permissions_doctor.check_permissions()
    assert impossible.verdict is CheckVerdict.FAILED
    assert "FIDIM_RUNTIME_DIR" in impossible.advice


def test_a_full_disk_is_seen(monkeypatch):
    monkeypatch.setattr(doctor.shutil, "disk_usage", lambda path: type("usage", (), {"free": 1e6})())
    assert doctor.check_disk().verdict is CheckVerdict.FAILED


@pytest.mark.usefixtures("well")
@pytest.mark.parametrize("by_name", [False, True])
def test_the_papers_robot_is_well(irma4_file: Path, by_name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    robot = "irma4" if by_name else str(irma4_file)
    assert cli.run(["doctor", "--robot", robot, "--json", "d.json"]) == 0
    checks = _read(tmp_path / "d.json")
    assert checks["robot irma4.toml"]["found"] == "4 cables, 1 marker, 11 kg"
    assert {check["verdict"] for name, check in checks.items() if name.startswith("robot")} == {"ok"}


@pytest.mark.usefixtures("well")
def test_an_implausible_robot_fails_and_a_soft_one_is_warned_about(irma4, tmp_path, cable_ring, capsys):
    write_robot(tmp_path / "weak.toml", replace(irma4, limits=Limits((190.0, 192.0))))
    assert cli.run(["doctor", "--robot", str(tmp_path / "weak.toml")]) == 1
    assert "robot weak.toml: rest" in capsys.readouterr().out.splitlines()[-1]
    write_robot(tmp_path / "five.toml", cable_ring(5))
    assert cli.run(["doctor", "--robot", str(tmp_path / "five.toml"), "--json", str(tmp_path / "d.json")]) == 0
    assert _read(tmp_path / "d.json")["robot five.toml: soft modes"]["verdict"] == "warning"


@pytest.mark.usefixtures("well")
def test_a_robot_file_that_does_not_read_fails_with_its_place(tmp_path, capsys):
    (tmp_path / "bad.toml").write_text('format = "fidim-robot/1"\nspeed = 3\n')
    assert cli.run(["doctor", "--robot", str(tmp_path / "bad.toml")]) == 1
    shown = " ".join(capsys.readouterr().out.split())
    assert "speed" in shown
    assert "correct the file" in shown


@pytest.mark.usefixtures("well")
def test_json_that_cannot_be_written_is_wrong_use(tmp_path, capsys):
    assert cli.run(["doctor", "--json", str(tmp_path / "none" / "d.json")]) == 2
    assert "cannot be written" in capsys.readouterr().err


def test_a_dictionary_alone_says_what_its_drive_can_do(tmp_path, capsys):
    assert cli.run(["doctor", "--eds", str(GENERIC_EDS), "--json", str(tmp_path / "d.json")]) == 0
    checks = _read(tmp_path / "d.json")
    assert [r.key for r in REQUIREMENTS] == list(checks)[1:]
    assert "Python" not in checks, "of this computer nothing was asked"
    assert checks["reaction to a lost host"]["found"] == "configured: 1016:1 + 6007:0"
    assert checks["reaction to a lost host"]["wanted"] == "must have, or be proven by trial"
    assert "All well." in capsys.readouterr().out


def test_what_a_dictionary_lacks_and_what_was_repaired_in_it(tmp_path, capsys):
    eds = tmp_path / "drive.eds"
    text = re.sub(r"\[(6007|607F)\][^\[]*", "", GENERIC_EDS.read_text(encoding="utf-8"))
    eds.write_text(text.replace("DefaultValue=0x00020192", "DefaultValue=0x00020192 # servo"), encoding="utf-8")
    assert cli.run(["doctor", "--eds", str(eds), "--family", "generic", "--json", str(tmp_path / "d.json")]) == 0
    checks = _read(tmp_path / "d.json")
    repair = checks["EDS file drive.eds"]
    assert repair["verdict"] == "warning"
    assert re.fullmatch(r"what follows # is taken as a comment: \[1000\] line \d+", repair["found"])
    assert checks["reaction to a lost host"]["found"] == "absent: no 6007:0"
    assert "fidim commission" in checks["reaction to a lost host"]["advice"]
    assert checks["speed limit"]["advice"].startswith("instead: each move's speed is checked")
    assert "Nothing is wrong. Before a run, prove by trial what 1 of the checks ask for" in capsys.readouterr().out


def test_a_family_may_say_that_the_drive_has_less(tmp_path):
    family = tmp_path / "ours.toml"
    family.write_text('format = "fidim-drive-family/1"\n[absent]\n"6041:0" = "for this test"\n')
    command = ["doctor", "--eds", str(GENERIC_EDS), "--family", str(family), "--json", str(tmp_path / "d.json")]
    assert cli.run(command) == 1
    checks = _read(tmp_path / "d.json")
    assert checks["state machine"]["found"] == "absent: no 6041:0"
    assert checks["samples at each SYNC"]["found"] == "absent: no TPDO carries 6041:0 (there is no such object)"


def test_the_dictionary_of_what_is_no_drive(tmp_path, capsys):
    eds = tmp_path / "module.eds"
    eds.write_text("[1000]\nParameterName=x\nDataType=7\nAccessType=ro\n")
    assert cli.run(["doctor", "--eds", str(eds)]) == 1
    assert "controlword" in capsys.readouterr().out
    eds.write_text("[6040]\nDataType=6\n[6040]\nDataType=7\n")
    assert cli.run(["doctor", "--eds", str(eds)]) == 2
    assert "[6040], line 3: DataType 7, but 6 for the same object in line 1" in capsys.readouterr().err.replace(
        "\n", " "
    )
    assert cli.run(["doctor", "--family", "generic"]) == 2


def test_a_makers_drive_in_the_generic_family_is_warned_of(tmp_path):
    """Another unit of speed is another speed."""
    text = GENERIC_EDS.read_text(encoding="utf-8")
    eds = tmp_path / "drive.eds"
    eds.write_text(re.sub(r"VendorName=.*", "VendorName=maxon motor ag", text), encoding="utf-8")
    for family, says in ((None, True), ("maxon-epos4", False)):
        chosen = ["--family", family] if family else []
        cli.run(["doctor", "--eds", str(eds), *chosen, "--json", str(tmp_path / "d.json")])
        checks = _read(tmp_path / "d.json")
        assert ("family of drive.eds" in checks) is says
        if says:
            assert "try family maxon-epos2, maxon-epos4" in checks["family of drive.eds"]["advice"]
