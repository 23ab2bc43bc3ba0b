"""Pages of docs that are made from the code say what the code does now."""

import os
import subprocess
import sys
from pathlib import Path

import click
import pytest

from fidim_lab.app.cli import fidim
from fidim_lab.app.cli.reference import commands_page
from fidim_lab.app.file_keys import file_keys_page
from fidim_lab.app.schema_words import range_words, type_words

DOCS = Path(__file__).parents[3] / "docs"


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
def test_the_tab_key_completes(words, found):
    command = "from fidim_lab.app.cli import main; main()"
    asked = {"_FIDIM_COMPLETE": "bash_complete", "COMP_WORDS": words, "COMP_CWORD": str(len(words.split()) - 1)}
    program = [sys.executable, "-c", f"import sys; sys.argv[0] = 'fidim'; {command}"]
    told = subprocess.run(program, env={**os.environ, **asked}, capture_output=True, text=True, timeout=60, check=False)
    assert [line.partition(",")[2] for line in told.stdout.splitlines()] == found.split()
