"""Types and access of the standards' objects that this program uses (CiA 301, CiA 402), for files that leave them out.

Also which of them are signed: makers who write 6064 as UNSIGNED32 mean the same register.
"""

from collections.abc import Mapping
from types import MappingProxyType

SIGNED: Mapping[int, int] = MappingProxyType(
    {0x02: 8, 0x03: 16, 0x10: 24, 0x04: 32, 0x12: 40, 0x13: 48, 0x14: 56, 0x15: 64}
)
UNSIGNED: Mapping[int, int] = MappingProxyType(
    {0x05: 8, 0x06: 16, 0x16: 24, 0x07: 32, 0x18: 40, 0x19: 48, 0x1A: 56, 0x1B: 64}
)
"""data type → bits"""
BOOLEAN, DOMAIN, HIGHEST = 0x01, 0x0F, 0x1B
FLOATS, TEXTS, BYTES = (0x08, 0x11), (0x09, 0x0B), (0x0A, DOMAIN)

NAMES: Mapping[str, int] = MappingProxyType(
    {
        "BOOLEAN": BOOLEAN,
        "VISIBLESTRING": 0x09,
        "OCTETSTRING": 0x0A,
        "UNICODESTRING": 0x0B,
        "DOMAIN": DOMAIN,
        "REAL32": 0x08,
        "REAL64": 0x11,
        **{f"{word}{bits}": kind for kind, bits in SIGNED.items() for word in ("INTEGER", "INT", "SINT")},
        **{f"{word}{bits}": kind for kind, bits in UNSIGNED.items() for word in ("UNSIGNED", "UINT", "U")},
    }
)
"""types by name, as files written by hand have them; blanks and underscores left out"""

_I8, _I16, _I32, _U8, _U16, _U32 = 0x02, 0x03, 0x04, 0x05, 0x06, 0x07
_TYPES: Mapping[int, tuple[int, ...]] = {
    _I8: (0x6060, 0x6061, 0x6098),
    _I16: (0x6007, 0x605A, 0x605B, 0x605C, 0x605D, 0x605E, 0x6071, 0x6074, 0x6077, 0x6078, 0x6086),
    _I32: (*(0x6062, 0x6063, 0x6064, 0x6069, 0x606B, 0x606C, 0x607A), *(0x607C, 0x60F4, 0x60FF)),
    _U8: (0x1001, 0x100D, 0x607E),
    _U16: (0x100C, 0x1017, 0x603F, 0x6040, 0x6041, 0x6066, 0x6068, 0x6072, 0x6073),
    _U32: (
        *(0x1000, 0x1005, 0x1006, 0x1014, 0x6065, 0x6067, 0x6075, 0x6076, 0x607F, 0x6080, 0x6081, 0x6083, 0x6084),
        *(0x6085, 0x60C5, 0x60C6, 0x60FD, 0x6502),
    ),
}
TYPES: Mapping[int, int] = MappingProxyType({index: kind for kind, every in _TYPES.items() for index in every})
_READ_ONLY = frozenset(
    (0x1000, 0x1001, 0x603F, 0x6041, 0x6061, 0x6062, 0x6063, 0x6064, 0x6069, 0x606B, 0x606C, 0x6074, 0x6077)
) | {0x6078, 0x60F4, 0x60FD, 0x6502}
_SAME_SIZE = {(0x02, 0x05), (0x03, 0x06), (0x04, 0x07)}


def known_type(index: int, sub: int) -> int | None:
    """The type that the standard gives an object; None for those that we do not use."""
    if 0x1400 <= index < 0x1C00:
        comm = index & 0x200 == 0
        return _U8 if sub == 0 or (comm and sub in (2, 4, 6)) else _U16 if comm and sub in (3, 5) else _U32
    if index in (0x1016, 0x1018, 0x608F, 0x6091, 0x6092, 0x6093, 0x60FE):
        return _U32 if sub else _U8
    if index == 0x607D:
        return _I32 if sub else _U8
    if index == 0x60C2:
        return (_U8, _U8, _I8)[min(sub, 2)]
    if index == 0x1029:
        return _U8
    return TYPES.get(index) if sub == 0 else None


def known_access(index: int) -> str | None:
    """Read only or not, by the standard; None for objects that we do not use."""
    if index in _READ_ONLY or index == 0x1018:
        return "ro"
    return (
        "rw"
        if index in TYPES or index in (0x1016, 0x1029, 0x607D, 0x60C2, 0x60FE) or 0x1400 <= index < 0x1C00
        else None
    )


def same_register(found: int, standard: int) -> bool:
    """Whether two types differ in their sign alone."""
    return found != standard and (min(found, standard), max(found, standard)) in _SAME_SIZE
