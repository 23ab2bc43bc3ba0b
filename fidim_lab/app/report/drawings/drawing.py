"""A picture with its caption, and the file that it becomes outside of a page."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from fidim_lab.errors import FileError

NAMESPACE = "http://www.w3.org/2000/svg"
LONGEST = 60


@dataclass(frozen=True)
class Drawing:
    """One picture, SVG not yet made distinct."""

    svg: str
    caption: str
    name: str = ""
    """what its file is called; from the caption where empty"""
    zoom: bool = True
    """whether a reader may want to see a part of it larger"""


def write_pictures(folder: Path, drawings: Iterable[Drawing]) -> tuple[Path, ...]:
    """Write each picture as an SVG file of its own, numbered in the order of the page; returns their paths.

    Raises FileError where the folder cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        paths: list[Path] = []
        for number, drawing in enumerate(drawings, start=1):
            path = folder / f"{number:02d}-{slug(drawing.name or drawing.caption)}.svg"
            write_svg(path, drawing.svg)
            paths.append(path)
    except OSError as error:
        raise FileError(folder, "", f"cannot be written: {error.strerror}") from None
    return tuple(paths)


def write_svg(path: Path, svg: str) -> None:
    """Write a picture of a page as a file that stands alone. Raises OSError."""
    alone = svg.replace("<svg ", f'<svg xmlns="{NAMESPACE}" ', 1)
    path.write_text(f'<?xml version="1.0" encoding="utf-8"?>\n{alone}\n', encoding="utf-8", newline="\n")


def slug(text: str) -> str:
    """Letters, digits and hyphens of a text: a name that every file system takes."""
    found = re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-")
    return found[:LONGEST].rstrip("-") or "picture"
