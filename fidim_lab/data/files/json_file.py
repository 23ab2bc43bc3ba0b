"""Values as JSON files hold them: `as_json` makes plain ones of records and arrays, `write_json` keeps them."""

import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from fidim_lab.data.files.whole_file import put_whole


def as_json(value: Any) -> Any:
    """A value as JSON has it: records as objects, sequences and arrays as lists, null for numbers that are none."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, Enum):
        return value.value
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: as_json(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, Mapping):
        return {key: as_json(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [as_json(one) for one in value]
    if isinstance(value, float):
        return value if isfinite(value) else None
    return str(value) if isinstance(value, Path) else value


def write_json(path: Path, value: Any) -> None:
    """Write a value, into a file whole or not at all. Raises OSError."""
    text = json.dumps(as_json(value), indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    if path.is_symlink() or (path.exists() and not path.is_file()):  # a pipe, a device: nothing may take its place
        path.write_text(text, encoding="utf-8")
    else:
        put_whole(path, text)
