"""An EDS file as object dictionary of a simulated drive (parsed by `canopen`, nothing else of which is used)."""

import configparser
import io
import struct
import warnings
from pathlib import Path
from typing import Any

from canopen.objectdictionary.eds import import_eds

from fidim_lab.data.files.eds_text import read_eds_text
from fidim_lab.errors import FileError
from sim_backends.drive.dictionary import Dictionary, ObjectSpec, Value

_CODES = {1: "?", 2: "b", 3: "h", 4: "i", 5: "B", 6: "H", 7: "I", 8: "f", 0x11: "d", 0x15: "q", 0x1B: "Q"}
"""CiA 301 data types; every other type is kept as bytes"""


def read_eds(path: Path, node_id: int) -> Dictionary:
    """The object dictionary in the EDS (or DCF) at `path`, its `$NODEID` resolved.

    A DCF's ParameterValue wins over the EDS's DefaultValue. Raises FileError where the file cannot be read, is no EDS,
    or gives a default that its type or range does not allow.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # canopen's own, where [DeviceInfo] is missing
            tree: Any = import_eds(io.StringIO(read_eds_text(path)), node_id)
    except (ValueError, LookupError, TypeError, AttributeError, configparser.Error) as problem:
        raise FileError(path, "", f"is no EDS file: {problem}") from problem
    variables: list[Any] = []
    for entry in tree.values():
        variables.extend(entry.values() if hasattr(entry, "values") else [entry])
    if not variables:
        raise FileError(path, "", "holds no objects", hint="An EDS has sections such as [1000] and [1018sub1].")
    return Dictionary(_spec(path, variable) for variable in variables)


def _spec(path: Path, variable: Any) -> ObjectSpec:
    code = _CODES.get(variable.data_type, "")
    access = str(variable.access_type)
    spec = ObjectSpec(
        index=int(variable.index),
        subindex=int(variable.subindex),
        name=str(variable.name),
        code=code,
        readable=access != "wo",
        writable=access not in ("ro", "const"),
        mappable=bool(variable.pdo_mappable),
        low=variable.min,
        high=variable.max,
        default=_default(code, variable.default if variable.value is None else variable.value),
    )
    place = f"[{spec.index:04X}sub{spec.subindex:X}]"
    try:
        spec.encode(spec.default)
    except struct.error as problem:
        raise FileError(path, place, f"default {spec.default!r} is not of its type: {problem}") from problem
    return spec


def _default(code: str, value: object) -> Value:
    if not code:
        return value.encode() if isinstance(value, str) else value if isinstance(value, bytes) else b""
    return value if isinstance(value, int | float) else 0
