"""The bytes of MATLAB .mat files, version 5 to 7: elements, numbers, text, cells, structs. Pure: bytes in, values out.

Own, because scipy's compiled reader (1.17) kills the whole process on many damaged uncompressed files: of 60 batches of
200 files with one byte changed none survived, an unknown type number is enough. A damaged file must end in a sentence.
What the importers do not need is refused by name: sparse matrices, objects, function handles, complex numbers,
version 7.3 (HDF5).

Source: MathWorks, "MAT-File Format" (level 5). Values: numbers and logicals become float arrays with MATLAB's
dimensions, text becomes str, cells become lists (column by column), a 1 × 1 struct a dict, other structs a list of
dicts.
"""

import math
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

HEADER_BYTES = 128
TAG_BYTES = 8
VERSION_5, VERSION_73 = 0x0100, 0x0200
MATRIX, COMPRESSED = 14, 15
NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
TEXTS = {1: "ascii", 2: "ascii", 4: "utf-16", 16: "utf-8", 17: "utf-16", 18: "utf-32"}
"""character data by element type; 16 and 32 bit units follow the file's byte order"""
CELL, STRUCT, CHAR = 1, 2, 4
NUMERIC = range(6, 16)
REFUSED = {3: "an object", 5: "a sparse matrix", 16: "a function handle", 17: "an object"}
COMPLEX = 0x0800
DEEPEST = 32
HEAD_BYTES = 1024
LARGEST = 1 << 27
"""bytes that one compressed variable may unpack to, half an hour of 30 channels at 200 Hz six times over"""
MOST_VALUES = 1 << 24
"""of one array: as numbers of 8 bytes 0.13 GB, whatever the file keeps them as"""


class DamagedError(ValueError):
    """The bytes are not a .mat file, or not a whole one; says what is wrong, for the reader of a file to place."""


@dataclass(frozen=True)
class Head:
    """What stands before a matrix's values."""

    kind: int
    dimensions: tuple[int, ...]
    name: str

    @property
    def count(self) -> int:
        """How many values."""
        return math.prod(self.dimensions)


@dataclass(frozen=True)
class Element:
    """One tagged element."""

    kind: int
    data: bytes


def read_variables(content: bytes) -> dict[str, Any]:
    """All variables of a file by name. Raises DamagedError."""
    order = _byte_order(content)
    return dict(_matrix(element.data, order, 0) for element in _unpacked(content, order, LARGEST))


def read_names(content: bytes) -> tuple[str, ...]:
    """The names of a file's variables, without unpacking their values. Raises DamagedError."""
    order = _byte_order(content)
    return tuple(_head(_elements(element.data, order), order).name for element in _unpacked(content, order, HEAD_BYTES))


def _byte_order(content: bytes) -> str:
    """'<' or '>'."""
    if len(content) < HEADER_BYTES:
        raise DamagedError(f"{len(content)} bytes; the header alone has {HEADER_BYTES}")
    order = {b"IM": "<", b"MI": ">"}.get(content[126:128])
    if order is None or not content.startswith(b"MATLAB"):
        raise DamagedError("there is no MATLAB header")
    (version,) = struct.unpack(order + "H", content[124:126])
    if version == VERSION_73:
        raise DamagedError("is of version 7.3 (HDF5), which is not read here; save it again with save('-v7', …)")
    if version != VERSION_5:
        raise DamagedError(f"has version {version:#06x}; {VERSION_5:#06x} was expected")
    return order


def _unpacked(content: bytes, order: str, largest: int) -> Iterator[Element]:
    """The file's variables as matrix elements; of compressed ones at most `largest` bytes."""
    for element in _elements(content[HEADER_BYTES:], order, padded=False):
        if element.kind != COMPRESSED:
            yield element
            continue
        try:
            unpacked = zlib.decompressobj().decompress(element.data, largest)
        except zlib.error as error:
            raise DamagedError(f"a compressed variable cannot be unpacked ({error})") from None
        if len(unpacked) < TAG_BYTES:
            raise DamagedError("a compressed variable is empty")
        kind, size = struct.unpack(order + "II", unpacked[:TAG_BYTES])
        if len(unpacked) < min(largest, TAG_BYTES + size):
            raise DamagedError("a compressed variable ends early")
        yield Element(kind, unpacked[TAG_BYTES : TAG_BYTES + size])


def _elements(content: bytes, order: str, *, padded: bool = True) -> Iterator[Element]:
    """Tagged elements one after the other; at the top level only a compressed one is not padded to 8 bytes."""
    at = 0
    while at < len(content):
        if len(content) - at < TAG_BYTES:
            raise DamagedError("the file ends within a tag")
        first, size = struct.unpack(order + "II", content[at : at + TAG_BYTES])
        if first >> 16:  # a small element: size and up to 4 bytes within the tag
            kind, size, begin, end = first & 0xFFFF, first >> 16, at + 4, at + TAG_BYTES
        else:
            kind, begin = first, at + TAG_BYTES
            whole = padded or kind != COMPRESSED
            end = begin + (size + 7) // 8 * 8 if whole else begin + size
        if begin + size > min(end, len(content)):
            raise DamagedError(f"an element of {size} bytes does not fit; is the file truncated?")
        yield Element(kind, content[begin : begin + size])
        at = end


def _head(parts: Iterator[Element], order: str) -> Head:
    """Class, dimensions and name; takes these three elements from `parts`."""
    flags = _integers(_next(parts, "flags"), order)
    dimensions = _integers(_next(parts, "dimensions"), order)
    name = _next(parts, "name").data.decode("ascii", "replace")
    if len(flags) != 2 or len(dimensions) < 2 or min(dimensions) < 0:
        raise DamagedError(f"the head of variable or field {name[:40]!r} is damaged")
    kind = flags[0] & 0xFF
    if kind in REFUSED or flags[0] & COMPLEX:
        raise DamagedError(f"{name[:40]!r} is {REFUSED.get(kind, 'complex')}, which is not read here")
    return Head(kind, dimensions, name)


def _matrix(content: bytes, order: str, depth: int) -> tuple[str, Any]:
    """Name and value of one matrix element."""
    if not content:  # what an empty field is written as
        return "", np.zeros((0, 0))
    if depth > DEEPEST:
        raise DamagedError(f"structs are nested more than {DEEPEST} deep")
    parts = _elements(content, order)
    head = _head(parts, order)
    if head.kind in NUMERIC:
        return head.name, _shaped(_numbers(_next(parts, "values"), order), head)
    if head.kind == CHAR:
        return head.name, _text(_next(parts, "text"), order)
    if head.kind == CELL:
        return head.name, [value for _, value in _members(parts, order, head.count, depth)]
    if head.kind == STRUCT:
        return head.name, _structs(parts, order, head, depth)
    raise DamagedError(f"{head.name[:40]!r} is of the unknown class {head.kind}")


def _structs(parts: Iterator[Element], order: str, head: Head, depth: int) -> Any:
    width = _integers(_next(parts, "width of field names"), order)
    names = _next(parts, "field names").data
    if len(width) != 1 or not 1 <= width[0] <= max(len(names), 1) or len(names) % width[0]:
        raise DamagedError(f"the field names of {head.name[:40]!r} are damaged")
    step = width[0]
    fields = [names[at : at + step].split(b"\0")[0].decode("ascii", "replace") for at in range(0, len(names), step)]
    members = _members(parts, order, head.count * len(fields), depth) if fields else iter(())
    values = [value for _, value in members]
    structs = [
        dict(zip(fields, values[at : at + len(fields)], strict=True)) for at in range(0, len(values), len(fields) or 1)
    ]
    return structs[0] if head.count == 1 and structs else structs


def _members(parts: Iterator[Element], order: str, count: int, depth: int) -> Iterator[tuple[str, Any]]:
    """So many matrices out of `parts`."""
    for _ in range(count):
        element = _next(parts, "member")
        if element.kind != MATRIX:
            raise DamagedError(f"a cell or field is an element of type {element.kind}, not a matrix")
        yield _matrix(element.data, order, depth + 1)


def _numbers(element: Element, order: str) -> np.ndarray:
    code = NUMBERS.get(element.kind)
    if code is None:
        raise DamagedError(f"numbers are stored as the unknown type {element.kind}")
    if len(element.data) % int(code[1]):
        raise DamagedError(f"{len(element.data)} bytes are not a whole count of {code} numbers")
    return np.frombuffer(element.data, dtype=order + code)


def _integers(element: Element, order: str) -> tuple[int, ...]:
    values = _numbers(element, order)
    if values.dtype.kind not in "iu":
        raise DamagedError("sizes are stored as fractions")
    return tuple(int(value) for value in values)


def _shaped(values: np.ndarray, head: Head) -> np.ndarray:
    if head.count > MOST_VALUES:
        raise DamagedError(f"{head.name[:40]!r} has {head.count} values; at most {MOST_VALUES} are read")
    if len(values) != head.count:
        wanted = " × ".join(str(size) for size in head.dimensions)
        raise DamagedError(f"{head.name[:40]!r} has {len(values)} values for {wanted}")
    return values.astype(float).reshape(head.dimensions, order="F")


def _text(element: Element, order: str) -> str:
    encoding = TEXTS.get(element.kind)
    if encoding is None:
        raise DamagedError(f"text is stored as the unknown type {element.kind}")
    suffix = "" if encoding in ("ascii", "utf-8") else "-le" if order == "<" else "-be"
    return element.data.decode(encoding + suffix, "replace")


def _next(parts: Iterator[Element], what: str) -> Element:
    element = next(parts, None)
    if element is None:
        raise DamagedError(f"ends before its {what}")
    return element
