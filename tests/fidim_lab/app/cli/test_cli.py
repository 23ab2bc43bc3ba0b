"""The command line as a user meets it: exit codes, sentences, no traceback (spec/formats.md)."""

import os
import subprocess
import sys
from pathlib import Path

import click
import pytest

from fidim_lab.app import cli
from fidim_lab.errors import DeviceError, FidimError, GuardError, InfeasibleError, RefusedError, SetupError

COMMANDS = sorted(cli.fidim.commands)


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help_with_an_example(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run([command, "--help"]) == 0
    said = capsys.readouterr().out
    assert "Example:" in said
    assert f"fidim {command} " in said


def test_help_lists_every_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["--help"]) == 0
    said = capsys.readouterr().out
    assert all(command in said for command in COMMANDS)
    assert {"dry-run", "identify", "import", "simulate", "report", "doctor"} <= set(COMMANDS)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["identify"], "Missing argument 'CAMPAIGN"),
        (["identify", "nowhere"], "nowhere: no such folder"),
        (["dry-run", "--sped", "3"], "No such option"),
        (["dry-run", "--equilibria", "0"], "0 is not in the range"),
        (["dry-run", "--robot", "none.toml"], "none.toml: no such file"),
        (["dry-run", "--hide", "gremlins"], "no effect is called 'gremlins'"),
        (["dry-run", "--light"], "--light needs --ui."),
        (["dry-run", "--ui", "--json", "a.json"], "--json cannot be used with --ui."),
        (["run", "a.toml", "--rig", "b.toml", "--hide", "air-drag-linear"], "--hide needs --embedded."),
        (["run", "a.toml", "--rig", "b.toml", "--seed", "2"], "--seed needs --embedded."),
        (
            ["simulate", "--robot", "irma4", "--out", "out", "--plan", "a.toml", "--equilibria", "3"],
            "cannot be used with --pla",
        ),
        (
            ["simulate", "--robot", "irma4", "--out", "out", "--plan", "a.toml", "--validate", "3"],
            "cannot be used with --plan",
        ),
        (["ui", "--port", "8421"], "--port needs --web."),
        (["fly"], "No such command 'fly'"),
        (["import", "vhs", "tape", "--out", "out"], "vhs"),
        (["report", "nowhere"], "nowhere"),
    ],
)
def test_wrong_use_is_two_and_a_sentence(
    arguments: list[str], said: str, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert cli.run(arguments) == 2
    error = capsys.readouterr().err
    assert said in error
    assert "Traceback" not in error
    assert list(tmp_path.iterdir()) == []


def _numbers():
    for name, command in sorted(cli.fidim.commands.items()):
        inner = command.commands.items() if isinstance(command, click.Group) else [("", command)]
        for below, one in inner:
            for parameter in one.params:
                if isinstance(parameter.type, click.FloatRange | click.types.FloatParamType):
                    yield pytest.param(parameter, id=f"{name} {below} {parameter.opts[0]}")


@pytest.mark.parametrize("parameter", list(_numbers()))
@pytest.mark.parametrize("number", ["nan", "inf", "-inf"])
def test_numbers_are_finite(parameter: click.Parameter, number: str) -> None:
    with pytest.raises(click.BadParameter, match=r"not a finite number|not in the range"):
        parameter.type.convert(number, parameter, None)


def test_a_number_that_is_none_is_wrong_use(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["design", "--by-winches", "--winch-speed", "nan"]) == 2
    assert "Invalid value for '--winch-speed': nan is not a finite number." in capsys.readouterr().err


@pytest.mark.parametrize(
    ("problem", "code"),
    [
        (SetupError("a"), 2),
        (RefusedError("b"), 1),
        (InfeasibleError("c"), 1),
        (DeviceError("winch 1", "silent"), 3),
        (GuardError("d"), 3),
        (KeyboardInterrupt(), 130),
        (click.Abort(), 130),
        (ZeroDivisionError("our bug"), 3),
    ],
)
def test_exit_codes(
    problem: BaseException, code: int, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> int:
        raise problem

    monkeypatch.setattr("fidim_lab.app.doctor.command.doctor_command", fail)
    assert cli.run(["doctor"]) == code
    error = capsys.readouterr().err
    assert "Traceback" not in error
    if isinstance(problem, FidimError):
        assert str(problem) in error


def test_debug_shows_the_traceback(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["identify", "nowhere", "--debug"]) == 2
    assert "Traceback" in capsys.readouterr().err


def test_help_is_quick() -> None:
    """`fidim --help` imports none of the heavy libraries."""
    code = (
        "import sys; from fidim_lab.app import cli; print(sorted({'casadi','scipy','pandas','can'} & set(sys.modules)))"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env={**os.environ})
    assert found.stdout.strip() == "[]"


def test_power_off_without_a_bus_is_hardware(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("FIDIM_RUNTIME_DIR", str(tmp_path))
    example = Path(__file__).parents[4] / "examples" / "rigs" / "simulated.toml"
    rig = tmp_path / "rig.toml"
    rig.write_text(example.read_text(encoding="utf-8").replace("socket://127.0.0.1:20100", "socket://127.0.0.1:1"))
    assert cli.run(["power-off", str(rig), "--yes"]) == 3
    assert "The CAN bus slcan socket://127.0.0.1:1 cannot be opened" in capsys.readouterr().err
