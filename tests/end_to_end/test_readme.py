"""What the README shows is what the commands print, and every command it names is there."""

import re
import runpy
from pathlib import Path
from typing import Any

import pytest

from fidim_lab.app import cli

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
ROW = re.compile(r"│ ([sI]_\w+) +│ +(-?[\d.]+) │ +([\d.]+) │ +(-?[\d.]+) │")
PRINTED = re.compile(r"│ (s_\w) +│ +(-?[\d.]+) │")
"""name, identified"""
CLOSE = 0.02
"""mm, 1e-3 m²: another processor's rounding may show in the last digits; another result must not"""


@pytest.fixture(scope="module")
def outputs() -> dict[str, Any]:
    return runpy.run_path(str(ROOT / "docs" / "outputs.py"))


def test_every_command_named_exists() -> None:
    named = set(re.findall(r"`?fidim ([a-z][a-z-]+)", README)) - {"command"}
    assert named
    assert named <= set(cli.fidim.commands)


def test_every_file_named_exists() -> None:
    links = re.findall(r"\]\(([^)#:]+)\)", README)
    assert links
    assert [link for link in links if not (ROOT / link).exists()] == []


def test_every_module_of_the_walk_exists() -> None:
    walk = README[README.index("## One equilibrium") : README.index("## Safety")]
    for name in re.findall(r"`([\w/]+(?:\.py|/))`", walk):
        places = [ROOT / name, ROOT / "fidim_lab" / name, ROOT / "fidim_lab" / "identification" / name]
        assert any(place.exists() for place in places), name


@pytest.mark.slow
def test_the_dry_run_prints_what_the_readme_shows(outputs: dict[str, Any]) -> None:
    ((command, shown),) = outputs["blocks"](README)
    printed = outputs["printed"](command)
    assert [line[:1] for line in printed.splitlines()] == [line[:1] for line in shown.splitlines()]
    rows = [ROW.findall(text) for text in (shown, printed)]
    assert len(rows[0]) >= 9
    for there, here in zip(*rows, strict=True):
        assert there[0] == here[0]
        assert [float(v) for v in here[1:]] == pytest.approx([float(v) for v in there[1:]], abs=CLOSE)


def test_the_picture_above_the_output_is_of_the_same_run(outputs: dict[str, Any]) -> None:
    pictures = runpy.run_path(str(ROOT / "docs" / "page_pictures.py"))
    (shown,) = re.findall(r"\((docs/pictures/\w+\.png)\)", README)
    said = pictures["description"](ROOT / shown)
    ((_, text),) = outputs["blocks"](README)
    first = text[: text.index("Independent of the choice of P")]
    rows = {name: float(value) for name, value in PRINTED.findall(first)}
    assert set(rows) >= {"s_x", "s_y", "s_z"}
    found = re.search(r"s = \((.*?)\) mm", said)
    assert found is not None, "make outputs draws it anew"
    drawn = [float(one.partition(" ±")[0]) for one in found[1].split(",")]
    for name, value in zip(("s_x", "s_y", "s_z"), drawn, strict=True):
        assert value == pytest.approx(rows[name], abs=1e-3), f"{name}: make outputs draws the picture anew"
