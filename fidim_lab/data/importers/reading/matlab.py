"""MATLAB .mat files with manners: every field that is wrong is a FileError with its name (`mat5` reads the bytes).

`variables` says what a file holds without reading it; `load_struct` opens one struct, whose fields are then asked for
with the shape they must have.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from fidim_lab.data.files.input_file import MIB, open_input, read_bytes
from fidim_lab.data.importers.reading.mat5 import DamagedError, read_names, read_variables
from fidim_lab.data.importers.reading.signatures import refuse_empty
from fidim_lab.errors import FileError

LIMIT = 256 * MIB
"""bytes; the largest public recording has 20 MiB"""

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class MatStruct:
    """One struct of a .mat file, and where in the file it stands."""

    path: Path
    place: str
    fields: Mapping[str, Any]

    def struct(self, name: str) -> "MatStruct":
        """A field that is a struct."""
        value = self._field(name)
        if not isinstance(value, Mapping):
            raise self._wrong(name, f"is {_kind(value)}; a struct was expected")
        return MatStruct(self.path, self._at(name), value)

    def structs(self, name: str) -> "tuple[MatStruct, ...]":
        """A field that is a cell or struct array of structs, one or more."""
        items = _items(self._field(name))
        if not items:
            raise self._wrong(name, "is empty; one struct or more was expected")
        for number, item in enumerate(items, start=1):
            if not isinstance(item, Mapping):
                raise self._wrong(f"{name}{{{number}}}", f"is {_kind(item)}; a struct was expected")
        return tuple(
            MatStruct(self.path, self._at(f"{name}{{{number}}}"), item) for number, item in enumerate(items, start=1)
        )

    def number(self, name: str) -> float:
        """A field that is one finite number."""
        return float(_checked(self, name, self._field(name), ()))

    def array(self, name: str, *shape: int | None) -> np.ndarray:
        """A field that is a finite numeric array of this shape; None is any length."""
        return _checked(self, name, self._field(name), shape)

    def samples(self, name: str, *shape: int | None) -> np.ndarray:
        """A field that is a numeric array of this shape, NaN where nothing was seen."""
        return _checked(self, name, self._field(name), shape, missing=True)

    def texts(self, name: str) -> tuple[str, ...]:
        """A field that is a text, or a cell array of texts."""
        items = _items(self._field(name))
        for item in items:
            if not isinstance(item, str):
                raise self._wrong(name, f"is {_kind(item)}; text was expected")
        return tuple(items)

    def cells(self, name: str, *shape: int | None) -> tuple[np.ndarray, ...]:
        """A field that is a cell array of numeric arrays of this shape."""
        items = _items(self._field(name))
        return tuple(_checked(self, f"{name}{{{k}}}", item, shape) for k, item in enumerate(items, start=1))

    def _field(self, name: str) -> Any:
        if name not in self.fields:
            raise self._wrong(name, f"is missing; found {', '.join(self.fields)[:120] or 'nothing'}")
        return self.fields[name]

    def _at(self, name: str) -> str:
        return f"{self.place}.{name}".lstrip(".")

    def _wrong(self, name: str, problem: str) -> FileError:
        return FileError(self.path, self._at(name), problem)


def variables(path: Path) -> tuple[str, ...]:
    """Names of the variables in a file. Raises FileError where it is not a readable .mat file."""
    return _carefully(path, read_names)


def is_matlab(path: Path) -> bool:
    """Whether a file begins as one of MATLAB's; of version 7.3, which is HDF5, only where MATLAB wrote it."""
    with open_input(path, LIMIT) as file:
        return file.read(6) == b"MATLAB"


def load_all(path: Path) -> Mapping[str, Any]:
    """All variables of a file. Raises FileError where it is not a readable .mat file."""
    return _carefully(path, read_variables)


def load_struct(path: Path, variable: str) -> MatStruct:
    """One struct variable of a file. Raises FileError where file or variable is not what it should be."""
    content = _carefully(path, read_variables)
    if variable not in content:
        raise FileError(path, variable, f"no such variable; found {', '.join(content)[:120] or 'nothing'}")
    value = content[variable]
    if not isinstance(value, Mapping):
        raise FileError(path, variable, f"is {_kind(value)}; a struct was expected")
    return MatStruct(path, variable, value)


def load_structs(path: Path, variable: str) -> tuple[MatStruct, ...]:
    """One variable of a file that is a struct array. Raises FileError where file or variable is something else."""
    return MatStruct(path, "", _carefully(path, read_variables)).structs(variable)


def load_array(path: Path, variable: str, *shape: int | None) -> np.ndarray:
    """One numeric variable of a file, of this shape; None is any length. Raises FileError where it is another thing."""
    return MatStruct(path, "", _carefully(path, read_variables)).array(variable, *shape)


def _carefully(path: Path, read: Callable[[bytes], T]) -> T:
    try:
        data = read_bytes(path, LIMIT)
        refuse_empty(path, data)
        return read(data)
    except DamagedError as error:
        raise FileError(path, "", f"is damaged or no .mat file: {error}") from None


def _items(value: Any) -> Sequence[Any]:
    """The elements of a cell or struct array; a 1 × 1 struct is its own only element."""
    return value if isinstance(value, list) else [value]


def _checked(
    owner: MatStruct, name: str, value: Any, shape: tuple[int | None, ...], *, missing: bool = False
) -> np.ndarray:
    """The value as an array of this shape: MATLAB has no vectors, so sizes of 1 do not count."""
    place = f"{owner.place}.{name}".lstrip(".")
    wanted = " × ".join("any" if size is None else str(size) for size in shape) or "one number"
    if not isinstance(value, np.ndarray):
        raise FileError(owner.path, place, f"is {_kind(value)}; numbers ({wanted}) were expected")
    as_said = len(value.shape) == len(shape) and all(w in (None, f) for w, f in zip(shape, value.shape, strict=True))
    found = [size for size in value.shape if as_said or size != 1]  # of those asked for, "any" may be 1
    sizes = [size for size in shape if as_said or size != 1]
    if len(found) != len(sizes) or any(w not in (None, f) for w, f in zip(sizes, found, strict=True)):
        has = " × ".join(str(size) for size in value.shape)
        raise FileError(owner.path, place, f"has shape {has}; {wanted} was expected")
    if not (np.isfinite(value) | (missing & np.isnan(value))).all():
        raise FileError(owner.path, place, "holds values that are not finite")
    remaining = iter(found)
    return value.reshape([1 if size == 1 and not as_said else next(remaining) for size in shape])


def _kind(value: Any) -> str:
    if isinstance(value, Mapping):
        return "a struct"
    if isinstance(value, np.ndarray):
        return f"an array of {' × '.join(str(size) for size in value.shape)} numbers"
    return "text" if isinstance(value, str) else "a cell or struct array"
