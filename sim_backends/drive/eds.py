"""An EDS file as object dictionary of a simulated drive (parsed by `canopen`, nothing else of which is used)."""

import struct
from pathlib import Path
from typing import Any

from fidim_lab.data.eds import read_dictionary
from fidim_lab.errors import FileError
from sim_backends.drive.dictionary import Dictionary, ObjectSpec, Value

_CODES = {1: "?", 2: "b", 3: "h", 4: "i", 5: "B", 6: "H", 7: "I", 8: "f", 0x11: "d", 0x15: "q", 0x1B: "Q"}
"""CiA 301 data types; every other type is kept as bytes"""


def read_eds(path: Path, node_id: int) -> Dictionary:
    """The object dictionary in the EDS (or DCF) at `path`, its `$NODEID` resolved.

    A DCF's ParameterValue wins over the EDS's DefaultValue. Raises FileError where the file cannot be read, is no EDS,
    or gives a default that its type or range does not allow.
    """
    tree: Any = read_dictionary(path, node_id).dictionary
    variables: list[Any] = []
    for entry in tree.values():
        variables.extend(entry.values() if hasattr(entry, "values") else [entry])
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
