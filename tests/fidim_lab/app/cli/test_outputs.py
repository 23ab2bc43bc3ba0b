"""What cannot be written is said before anything is computed, by every command in the same words."""

import errno
import os
from pathlib import Path

import click
import pytest

from fidim_lab.app.cli import fidim, run
from fidim_lab.app.cli.outputs import OUT_FILE, OUT_FOLDER, Output, Writing

WITHOUT_A_CHECK = {"stop", "power-off"}
"""what they do comes first"""
ARGUMENTS = {
    "benchmark explain": ["--out", "OUT"],
    "brake": ["rig.toml", "winch 1", "--release"],
    "commission": ["rig.toml", "--by", "me"],
    "compare": ["CAMPAIGN", "CAMPAIGN"],
    "dry-run": [],
    "design": [],
    "doctor": [],
    "export": ["CAMPAIGN", "--to", "csv"],
    "import": ["irma4u", "CAMPAIGN", "--out", "OUT"],
    "init": ["robot"],
    "ls": ["CAMPAIGN"],
    "register": ["CAMPAIGN", "--out", "OUT"],
    "reproduce": [],
    "run": ["plan.toml", "--rig", "rig.toml"],
    "simulate": ["--robot", "irma4", "--out", "OUT"],
    "validate": ["CAMPAIGN", "--parameters", "result.json"],
}
"""where it is more or less than a folder"""


def _commands():
    for name, command in sorted(fidim.commands.items()):
        inner = command.commands.items() if isinstance(command, click.Group) else [("", command)]
        for below, one in inner:
            yield f"{name} {below}".strip(), one


def _writing():
    for name, command in _commands():
        for parameter in command.params:
            if isinstance(parameter.type, Output):
                yield pytest.param(name, parameter.opts[0], parameter.type, id=f"{name} {parameter.opts[0]}")


@pytest.mark.parametrize(("name", "command"), [pytest.param(*one, id=one[0]) for one in _commands()])
def test_every_output_is_checked(name, command):
    if name in WITHOUT_A_CHECK:
        return
    for parameter in command.params:
        if {"--json", "--out", "--report", "--pictures", "--page"} & set(parameter.opts):
            assert isinstance(parameter.type, Output), f"{name} {parameter.opts[0]}"
            assert isinstance(command, Writing)


@pytest.mark.parametrize(("name", "option", "kind"), list(_writing()))
def test_an_output_that_cannot_be_written_is_refused_before_any_work(name, option, kind, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("mine")
    path = tmp_path / "file" / "x" if kind.makes else tmp_path / "nowhere" / "x.json"
    assert run([*name.split(), *ARGUMENTS.get(name, ["CAMPAIGN"]), option, str(path)]) == 2
    said = capsys.readouterr().err
    assert f"fidim: {option} {path}: cannot be written: " in said
    assert "Choose a folder that exists and is yours." in said
    assert [one.name for one in tmp_path.iterdir()] == ["file"]


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="no /proc")
def test_a_folder_in_which_nothing_can_be_made(capsys):
    assert run(["design", "--out", "/proc/x"]) == 2
    assert "--out /proc/x: cannot be written: " in capsys.readouterr().err


def test_a_file_is_no_folder(tmp_path, capsys):
    (tmp_path / "file").write_text("mine")
    assert run(["design", "--out", str(tmp_path / "file")]) == 2
    assert "exists already and is a file" in capsys.readouterr().err
    assert (tmp_path / "file").read_text() == "mine"


@pytest.fixture
def command():
    def make(work):
        @click.command(cls=Writing)
        @click.option("--out", type=OUT_FOLDER)
        @click.option("--json", "json_file", type=OUT_FILE)
        def something(out, json_file):
            work(out, json_file)

        return something

    return make


@pytest.fixture
def said(command, monkeypatch, capsys):
    def call(work, *arguments):
        monkeypatch.setitem(fidim.commands, "something", command(work))
        code = run(["something", *map(str, arguments)])
        return code, capsys.readouterr().err

    return call


def test_an_answer_may_lie_in_a_folder_that_the_command_makes(said, tmp_path):
    def work(out, json_file):
        out.mkdir(parents=True)
        json_file.write_text("{}")

    assert said(work, "--json", tmp_path / "a" / "b" / "x.json", "--out", tmp_path / "a" / "b") == (0, "")


def test_devices_and_files_that_are_there_are_taken(said, tmp_path):
    (tmp_path / "x.json").write_text("old")
    assert said(lambda out, json_file: None, "--json", os.devnull)[0] == 0
    assert said(lambda out, json_file: json_file.write_text("new"), "--json", tmp_path / "x.json")[0] == 0
    assert [one.name for one in tmp_path.iterdir()] == ["x.json"]


def test_what_fails_later_is_said_in_words(said, tmp_path):
    def gone(out, json_file):
        (out / "deep" / "plan.toml").write_text("")

    def full(out, json_file):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    code, words = said(gone, "--out", tmp_path / "new")
    assert (code, "new: cannot be written: No such file" in words) == (2, True), words
    code, words = said(full, "--json", tmp_path / "x.json")
    assert (code, "cannot be written: No space left on device. Free some disk space" in words) == (3, True), words


def test_a_file_that_cannot_be_read_is_named_not_called_a_bug(said, tmp_path):
    code, words = said(lambda out, json_file: (tmp_path / "absent").read_text(), "--json", tmp_path / "x" / "..")
    assert code == 2, "a folder is no file"
    code, words = said(lambda out, json_file: (tmp_path / "absent").read_text(), "--json", tmp_path / "x.json")
    assert (code, "absent: No such file" in words) == (2, True), words


@pytest.mark.parametrize(
    ("typed", "options"), [(["init", "robot", "robot.toml"], "--out, --robot"), (["dry-run", "out"], "--out, --robot")]
)
def test_a_word_too_many_is_told_which_options_take_a_file(typed, options, capsys):
    assert run(typed) == 2
    assert f"“{typed[-1]}” is not expected here. Give files and folders with {options}" in capsys.readouterr().err
