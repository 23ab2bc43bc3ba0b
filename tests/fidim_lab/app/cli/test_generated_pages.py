"""Pages of docs that are made from the code say what the code does now."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import click
import pytest

from docs.tools.commands import commands_page
from docs.tools.file_keys import file_keys_page
from docs.tools.schema_words import type_words
from fidim_lab.app.cli import fidim
from fidim_lab.app.cli.completion import Bash
from fidim_lab.app.formats.key_words import range_words

DOCS = Path(__file__).parents[4] / "docs"


def test_every_command_with_its_options_is_in_the_reference():
    page = (DOCS / "commands.md").read_text(encoding="utf-8")
    assert page == commands_page(), "make reference"
    for name, command in fidim.commands.items():
        assert f"### `fidim {name}`" in page
        options = [one for one in command.params if isinstance(one, click.Option) and not one.hidden]
        assert all(one.opts[0] in page for one in options)


def test_every_key_of_a_file_is_in_the_reference():
    page = (DOCS / "file-keys.md").read_text(encoding="utf-8")
    assert page == file_keys_page(), "make reference"
    assert "| `counts_per_turn` | number | > 0 |" in page


def test_types_and_ranges_are_said_in_words():
    assert type_words({"anyOf": [{"type": "number"}, {"type": "null"}]}) == "number or null"
    assert type_words({"type": "array", "items": {"$ref": "#/$defs/A"}}) == "list of A"
    assert (
        range_words({"anyOf": [{"type": "number", "exclusiveMinimum": 0, "maximum": 1}, {"type": "null"}]})
        == "> 0, ≤ 1"
    )
    assert range_words({"type": "string"}) == ""


@pytest.mark.parametrize(
    ("words", "found"),
    [("fidim exp", "explain export"), ("fidim export --to mj", "mjcf"), ("fidim dry-run --hi", "--hide")],
)
def test_the_tab_key_completes(words, found, monkeypatch):
    monkeypatch.setenv("COMP_WORDS", words)
    monkeypatch.setenv("COMP_CWORD", str(len(words.split()) - 1))
    assert _offered() == found.split()


def _offered():
    said = Bash(fidim, {}, "fidim", "_FIDIM_COMPLETE").complete()
    return [line.partition(",")[2] for line in said.splitlines()]


@pytest.mark.parametrize(
    ("line", "found"),
    [
        ("fidim dry-run --hide rotational-drag-", "rotational-drag-quadratic rotational-drag-quadratic:"),
        ("fidim run plan.toml --hide cable-elasticity:", "cable= EA= k= c="),
        ("fidim simulate --hide cable-elasticity:k=1,c", "1,cable= 1,c="),
        ("fidim simulators rig.toml --hide cable-elasticity:k=1,k", ""),
        ("fidim dry-run --hide no-such-effect:", ""),
    ],
)
def test_the_tab_key_knows_effects_and_their_keys_and_where_bash_breaks_words(line, found, monkeypatch):
    monkeypatch.setenv("COMP_LINE", line)
    monkeypatch.setenv("COMP_WORDBREAKS", " \"'><=;|&(:")
    assert _offered() == found.split()


def test_the_command_itself_answers_the_tab_key():
    command = "from fidim_lab.app.cli import main; main()"
    program = [sys.executable, "-c", f"import sys; sys.argv[0] = 'fidim'; {command}"]
    environment = {**os.environ, "_FIDIM_COMPLETE": "bash_complete", "COMP_LINE": "fidim exp"}
    told = subprocess.run(program, env=environment, capture_output=True, text=True, timeout=60, check=False)
    assert told.stdout.split() == ["plain,explain", "plain,export"]


@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash")
def test_bash_takes_the_completion_that_it_is_given(tmp_path):
    told = tmp_path / "fidim"
    told.write_text("#!/bin/sh\nprintf 'plain,c=\\nplain,dx=\\n'\n", encoding="utf-8")
    told.chmod(0o755)
    source = Bash(fidim, {}, "fidim", "_FIDIM_COMPLETE").source()
    asked = f"{source}\ncompopt() {{ :; }}; COMP_LINE='fidim x' COMP_POINT=7; {Bash(fidim, {}, 'fidim', '').func_name}"
    script = f"{asked} {told}; printf '%s ' \"${{COMPREPLY[@]}}\""
    shown = subprocess.run(["bash", "--norc", "-c", script], capture_output=True, text=True, timeout=60, check=True)
    assert shown.stdout == "c= dx= "
    assert shown.stderr == ""
