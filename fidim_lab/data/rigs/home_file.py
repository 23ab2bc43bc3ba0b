"""Where the encoders' zeros are, as `home` has found them: RIG.home.toml beside the rig file ("fidim-home/1").

Written by this program, readable for people. The rig file's own home_count and home_length count where there is none.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal

import tomli_w
from pydantic import Field

from fidim_lab.data.files.toml_file import Count, Name, Positive, Table, Word, read_toml
from fidim_lab.data.files.whole_file import write_whole

FORMAT = "fidim-home/1"


class WinchHome(Table):
    """The zero of a winch's encoder, as `home` has found it."""

    node_id: Annotated[int, Field(ge=1, le=126)]
    vendor_id: Word
    product_code: Word
    serial_number: Word
    home_count: Count
    home_length: Positive
    """m"""
    at: str
    """ISO 8601"""
    last_count: Count | None = None
    """where the encoder was seen last"""


class _WinchTable(WinchHome):
    name: Name


class _HomeTable(Table):
    format: Literal["fidim-home/1"]
    winch: list[_WinchTable]


def home_path(rig: Path) -> Path:
    """Beside the rig file."""
    return rig.with_suffix(".home.toml")


def read_homes(rig: Path) -> Mapping[str, WinchHome]:
    """By the winches' names; empty without a file. Raises FileError for one that is none."""
    path = home_path(rig)
    if not path.exists():
        return {}
    table = read_toml(path, _HomeTable, FORMAT)
    return {winch.name: WinchHome(**winch.model_dump(exclude={"name"})) for winch in table.winch}


def write_homes(rig: Path, homes: Mapping[str, WinchHome]) -> Path:
    """Write what `read_homes` reads, whole or not at all. Raises HardwareError where the disk does not take it."""
    path = home_path(rig)
    rows = [{"name": name} | {k: v for k, v in vars(home).items() if v is not None} for name, home in homes.items()]
    head = "# Written by fidim (procedure home); delete it to go by the rig file's home_count again.\n"
    return write_whole(path, head + tomli_w.dumps({"format": FORMAT, "winch": rows}))
