"""Arrays of MATLAB files and records of JSON as the table they could have been written as.

Every array with as many samples as most others have becomes columns named after it: a vector one, places (three
numbers a sample) x, y and z, rotations q0 to q3 or r11 to r33, places of several markers those of each by its label.
What else there is, such as settings, is left out. So a column map reads these files as it reads a text.
"""

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fidim_lab.data.files.input_file import JSON_LIMIT, MIB, parse_json
from fidim_lab.data.importers.reading.cells import MIN_FRAMES, read_export
from fidim_lab.data.importers.reading.matlab import is_matlab, load_all
from fidim_lab.errors import FileError

NO_NUMBER = re.compile(r"(?<=[\[,:\s])-?(NaN|Infinity)(?=[\],}\s])")
"""of Python's json, which is no JSON"""
RATE = re.compile(r"fs|f_s|.*(rate|freq)\w*|hz", re.IGNORECASE)
TIME = re.compile(r"(.*[._ ])?(t|time\w*|stamp\w*)", re.IGNORECASE)
"""names of one number, Hz; and of stamps"""
MOST_COLUMNS = 3000


def read_table(path: Path) -> str:
    """The text of a table, comma-separated where the file is MATLAB's or JSON. Raises FileError as `read_export`."""
    if is_matlab(path):
        return _text(path, load_all(path))
    text = read_export(path)
    return _text(path, _records(path, text)) if text.lstrip().startswith(("{", "[{", "[\n")) else text


def _records(path: Path, text: str) -> Any:
    """What a JSON file holds, a value or one in each line."""
    text = NO_NUMBER.sub("null", text)
    lines = [(k, line) for k, line in enumerate(text.splitlines(), start=1) if line.strip()]
    if len(lines) > 1 and lines[0][1].strip().endswith("}"):
        return _merged([parse_json(path, line, f"line {k}") for k, line in lines])
    if len(text) > JSON_LIMIT:
        what = f"is JSON of {len(text) / MIB:.0f} MiB in one piece; {JSON_LIMIT / MIB:g} MiB are read."
        raise FileError(path, "", what, hint="Write one record in each line.")
    return _merged(parse_json(path, text))


def _merged(value: Any) -> Any:
    """Records with the same keys as one mapping of arrays; lists of numbers as arrays where they are no ragged ones."""
    if isinstance(value, Mapping):
        return {key: _merged(one) for key, one in value.items()}
    if not isinstance(value, list) or not value:
        return value
    if any(isinstance(one, Mapping) for one in value):
        records = [one if isinstance(one, Mapping) else {} for one in value]
        keys = dict.fromkeys(key for one in records for key in one)
        return {key: _merged([one.get(key) for one in records]) for key in keys}
    if all(one is None or isinstance(one, str) for one in value):
        return value
    like = next((one for one in value if one is not None), None)
    try:
        gaps = np.full(np.shape(like), None).tolist() if isinstance(like, list) else None
        return np.array([gaps if one is None else one for one in value], dtype=float)
    except (ValueError, TypeError):  # ragged, or words among numbers
        return value


def _text(path: Path, content: Any) -> str:
    """The table, a line of names and a row for each sample. Raises FileError where no array has samples."""
    leaves = dict(_leaves(content, ""))
    arrays = {name: value for name, value in leaves.items() if isinstance(value, np.ndarray)}
    sizes: Counter[int] = Counter(size for array in arrays.values() for size in {*array.shape} if size >= MIN_FRAMES)
    if not sizes:
        found = ", ".join(leaves)[:150] or "nothing"
        raise FileError(path, "", f"has no array of {MIN_FRAMES} samples or more; found {found}")
    samples = max(sizes, key=lambda size: (sizes[size], size))
    labels = [value for value in leaves.values() if isinstance(value, list)]
    short = Counter(name.rpartition(".")[2] for name in arrays)
    columns: dict[str, np.ndarray] = {}
    for name, array in arrays.items():
        last = name.rpartition(".")[2]
        columns |= _columns(last if short[last] == 1 else name, array, samples, labels)
    goes_on = next((name for name, column in columns.items() if (np.diff(column) > 0.0).all()), None)
    if any(map(TIME.fullmatch, columns)):
        pass
    elif goes_on is not None:
        columns = {goes_on: columns[goes_on], **columns}
    else:
        rates = [
            float(a.item()) for name, a in arrays.items() if a.size == 1 and RATE.fullmatch(name.rpartition(".")[2])
        ]
        rate = rates[0] if len(rates) == 1 and rates[0] > 0.0 else 1.0
        columns = {"time": np.arange(samples) / rate, **columns}
    if len(columns) > MOST_COLUMNS:
        raise FileError(path, "", f"has {len(columns)} columns of {samples} samples; {MOST_COLUMNS} are read")
    names = [re.sub(r'[",;\s]+', "_", name) for name in columns]
    rows = ([repr(x) if x == x else "" for x in row] for row in np.column_stack([*columns.values()]).tolist())
    return "\n".join([",".join(names), *(",".join(row) for row in rows), ""])


def _leaves(value: Any, name: str) -> Iterator[tuple[str, Any]]:
    """Arrays and lists of words by the names on the way to them."""
    if isinstance(value, list) and len(value) == 1:
        value = value[0]
    if isinstance(value, Mapping):
        for key, one in value.items():
            yield from _leaves(one, f"{name}.{key}".lstrip("."))
    elif isinstance(value, list) and value and not all(isinstance(one, str) for one in value):
        for k, one in enumerate(value, start=1):
            yield from _leaves(one, f"{name}_{k}")
    else:
        yield name, np.array(float(value)) if isinstance(value, int | float) else value


def _columns(name: str, array: np.ndarray, samples: int, labels: Sequence[Sequence[str]]) -> dict[str, np.ndarray]:
    """Columns of an array by name; none where it has no such axis."""
    if samples not in array.shape:
        return {}
    parts = np.moveaxis(array, array.shape.index(samples), 0)
    parts = parts.reshape(samples, *(size for size in parts.shape[1:] if size != 1))
    if parts.ndim == 1:
        return {name: parts}
    if _are_rotations(parts):
        return {f"{name} r{i + 1}{j + 1}": parts[:, i, j] for i in range(3) for j in range(3)}
    if parts.ndim == 3 and 3 in parts.shape[1:]:
        places = parts if parts.shape[2] == 3 else parts.swapaxes(1, 2)
        count = places.shape[1]
        named = next((one for one in labels if len(one) == len({*one}) == count), None)
        named = named or [f"{name}_{k + 1}" for k in range(count)]
        return {f"{label} {axis}": places[:, k, a] for k, label in enumerate(named) for a, axis in enumerate("xyz")}
    flat = parts.reshape(samples, -1)
    ends = {3: [f" {axis}" for axis in "xyz"], 4: [f" q{k}" for k in range(4)]}.get(flat.shape[1])
    return {f"{name}{end}": flat[:, k] for k, end in enumerate(ends or [f"_{k + 1}" for k in range(flat.shape[1])])}


def _are_rotations(parts: np.ndarray) -> bool:
    """Whether each sample of (N, 3, 3) is a rotation matrix: places of three markers are none."""
    if parts.shape[1:] != (3, 3):
        return False
    known = parts[np.isfinite(parts).all(axis=(1, 2))]
    return bool(len(known)) and bool(np.allclose(known @ known.swapaxes(1, 2), np.eye(3), atol=0.02))
