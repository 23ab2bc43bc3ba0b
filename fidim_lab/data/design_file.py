"""Designs ("fidim-design/1", JSON) read as plans: what `fidim design --json` wrote, or another program did.

`read_plan_or_design` takes either kind of file, so that a design goes into `fidim run` as it is.
"""

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from fidim_lab.data.files.input_file import read_json
from fidim_lab.data.files.toml_file import Table, validated
from fidim_lab.data.plan_file import read_plan
from fidim_lab.data.records import Plan, PlannedWindow, Role
from fidim_lab.errors import FileError

FORMAT = "fidim-design/1"
Length = Annotated[float, Field(gt=0)]


class StartTable(Table):
    """One start of the search."""

    C: float | None = None
    value: float | None = None
    seconds: float


class EquilibriumTable(Table):
    """One place, and the motion about it."""

    lengths: list[Length]
    """m"""
    displacement: tuple[float, float]
    """m, of the marker's x, y from rest, at t = 0, at zero speed"""
    position: tuple[float, float, float]
    """m, of the marker at rest"""
    tension: tuple[float, float] | None = None
    """N, smallest and largest over the window"""
    conditioning: float | None = None


class DesignTable(Table):
    """The whole file, as spec/formats.md fixes it."""

    format: Literal["fidim-design/1"]
    criterion: Literal["C", "A", "D"]
    C: float | None = None
    value: float | None = None
    starts: Annotated[list[StartTable], Field(default_factory=list)]
    pool: int | None = None
    seconds: float | None = None
    equilibria: Annotated[list[EquilibriumTable], Field(min_length=1)]
    predicted_sd: Annotated[dict[str, float], Field(default_factory=dict)]


def read_plan_or_design(path: Path, cables: int) -> Plan:
    """A plan (TOML), or a design (JSON) as one, for a robot of so many cables. Raises FileError naming wrong keys."""
    return read_design(path, cables) if path.suffix == ".json" else read_plan(path, cables)


def read_design(path: Path, cables: int) -> Plan:
    """A design as a plan named after its file: windows d01, d02, … to identify. Raises FileError."""
    found = read_json(path)
    if not isinstance(found, dict):
        raise FileError(path, "", f"is not a design: an object with the format {FORMAT!r} is expected")
    table = validated(path, found, DesignTable, FORMAT)
    for number, one in enumerate(table.equilibria, start=1):
        if len(one.lengths) != cables:
            place, says = f"equilibria {number}, lengths", f"{len(one.lengths)} values for a robot of {cables} cables"
            raise FileError(path, place, says)
    return Plan(path.stem, tuple(_window(number, one) for number, one in enumerate(table.equilibria, start=1)))


def _window(number: int, one: EquilibriumTable) -> PlannedWindow:
    return PlannedWindow(
        f"d{number:02d}", Role.IDENTIFY, np.array(one.lengths), np.array(one.displacement), np.array(one.position)
    )
