"""An EDS file as object dictionary of a simulated drive (parsed by `canopen`, nothing else of which is used)."""

import struct
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from fidim_lab.data.eds import EdsFile, read_dictionary
from fidim_lab.errors import FileError
from sim_backends.drive.objects.dictionary import Dictionary, ObjectSpec, Value

_RATIOS = (0x608F, 0x6091, 0x6092, 0x6093)


def counted_as_it_is(od: Dictionary) -> Dictionary:
    """The same dictionary; what an EDS file has as defaults would be another drive's mechanics."""
    od.fix(0x607E, 0, 0)
    for index in _RATIOS:
        for sub in (1, 2):
            od.fix(index, sub, 1)
    return od


_CODES = {1: "?", 2: "b", 3: "h", 4: "i", 5: "B", 6: "H", 7: "I", 8: "f", 0x11: "d", 0x15: "q", 0x1B: "Q"}
"""CiA 301 data types; every other type is kept as bytes"""
_FIRST_OF_MAKER = 0x2000
_PROFILE = 402
_SERVO = 0x20192
"""1000 of a servo drive"""
_OFF = 1 << 31
_FIRST_PDOS = {0x1400: 0x200, 0x1800: 0x180}
"""identifiers of the predefined connection set: of the first PDO, 0x100 more of each next one"""
_PREDEFINED = 4
_STANDARD: Mapping[tuple[int, int], int] = {
    **{(0x1005, 0): 0x80, (0x6007, 0): 1, (0x605A, 0): 2, (0x605B, 0): 0, (0x605C, 0): 1, (0x605D, 0): 1},
    **{(0x605E, 0): 2, (0x6065, 0): 0xFFFFFFFF, (0x6072, 0): 1000, (0x6073, 0): 1000, (0x607F, 0): 0x7FFFFFFF},
    **{(0x6081, 0): 1000, (0x6083, 0): 1000, (0x6085, 0): 10000, (0x60C2, 2): -3},
}
"""values of the standards, or ones with which a drive moves, where a file gives none"""


def read_eds(path: Path, node_id: int) -> Dictionary:
    """The object dictionary in the EDS (or DCF) at `path`, its `$NODEID` resolved.

    Raises FileError where the file cannot be read or is no EDS.
    """
    return make_dictionary(read_dictionary(path, node_id), node_id)


def make_dictionary(found: EdsFile, node_id: int) -> Dictionary:
    """The same of a file that was read for this node.

    Entries of a mapping that can be written can be counted, too, whatever the file says of their number: nothing else
    could change them. A DCF's ParameterValue wins over the EDS's DefaultValue. A real drive has a value in every
    object: where the file gives none, it is the standard's, so that any file of a drive makes a node.
    """
    path = found.path
    tree: Any = found.dictionary
    variables: list[Any] = []
    for entry in tree.values():
        variables.extend(entry.values() if hasattr(entry, "values") else [entry])
    given = {(int(v.index), int(v.subindex)): v.default if v.value is None else v.value for v in variables}
    filled = _filled(given, node_id)
    specs = (_spec(path, variable, filled[variable.index, variable.subindex]) for variable in variables)
    mapped = {int(v.index) for v in variables if _is_mapping(v.index) and v.subindex and _writable(v)}
    counts = (replace(s, writable=True) if s.subindex == 0 and s.index in mapped else s for s in specs)
    return counted_as_it_is(Dictionary(counts))


def _filled(given: Mapping[tuple[int, int], Any], node_id: int) -> dict[tuple[int, int], Any]:
    """What stands in each object at power-on."""
    found = dict(given)
    for key, value in given.items():
        index, sub = key
        if value is None:
            found[key] = _STANDARD.get(key, value)
            if sub == 0 and (index, 1) in given and not _is_mapping(index):
                found[key] = _highest(given, index)
        base = index & 0xFF00
        if sub == 1 and base in _FIRST_PDOS and not value:
            number = index - base
            cob = _FIRST_PDOS[base] + 0x100 * number + node_id if number < _PREDEFINED else 0
            found[key] = _OFF | cob
    if (0x6040, 0) in given and int(found.get((0x1000, 0)) or 0) & 0xFFFF != _PROFILE:
        found[0x1000, 0] = _SERVO
    if not found.get((0x1014, 0), 1):
        found[0x1014, 0] = 0x80 + node_id
    return found


def _is_mapping(index: int) -> bool:
    return 0x1600 <= index < 0x1800 or 0x1A00 <= index < 0x1C00 or index == 0x1003


def _writable(variable: Any) -> bool:
    return str(variable.access_type) not in ("ro", "const")


def _highest(keys: Iterable[tuple[int, int]], index: int) -> int:
    return max(sub for at, sub in keys if at == index)


def _spec(path: Path, variable: Any, value: Any) -> ObjectSpec:
    code = _CODES.get(variable.data_type, "")
    access = str(variable.access_type)
    ranged = variable.index >= _FIRST_OF_MAKER  # ranges of communication objects are copied from elsewhere too often
    spec = ObjectSpec(
        index=int(variable.index),
        subindex=int(variable.subindex),
        name=str(variable.name),
        code=code,
        readable=access != "wo",
        writable=_writable(variable),
        mappable=bool(variable.pdo_mappable),
        low=variable.min if ranged else None,
        high=variable.max if ranged else None,
        default=_default(code, value),
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
