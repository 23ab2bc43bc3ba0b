"""The recorded session of the site: what a command prints is in the picture, when it came."""

import re
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from docs import recording

SVG = {"s": "http://www.w3.org/2000/svg"}
ROOT = Path(__file__).parents[2]


def texts(root: ET.Element) -> list[str]:
    return ["".join(line.itertext()) for line in root.findall(".//s:text", SVG)]


def test_lines_appear_one_after_the_other_and_the_last_screen_stays(tmp_path: Path) -> None:
    shown = recording.record(["fidim --version", "fidim ls ."], tmp_path)
    root = ET.fromstring(recording.picture(shown))
    said = texts(root)
    assert said[0] == "$ fidim --version"
    assert any(re.match(r"fidim.* \d+\.\d+", line) for line in said)
    assert "$ fidim ls ." in said
    begins = [float(re.findall(r"[\d.]+", line.attrib["style"])[0]) for line in root.findall(".//s:text", SVG)]
    assert begins == sorted(begins)
    assert {line.attrib["class"] for line in root.findall(".//s:text", SVG)} == {"a"}  # nothing was overwritten


def test_what_fails_is_no_recording(tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match="no-such-command: exit code 2"):
        recording.record(["fidim no-such-command"], tmp_path)


def test_the_picture_of_the_site_is_of_these_commands() -> None:
    said = texts(ET.parse(ROOT / "docs" / "pictures" / "session.svg").getroot())
    for command in recording.COMMANDS:
        assert f"$ {command}" in said
    assert any("swivel-friction" in line and "Left out" in line for line in said)
