"""What the dictionary's 14xx–1Axx entries mean: PDOs ready to pack and unpack, and which writes to them are refused.

Mapping and COB-ID are turned into one `struct` each time they change, so that a SYNC costs only the packing.
"""

import struct
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from sim_backends.drive.objects.abort import AbortCode
from sim_backends.drive.objects.dictionary import Dictionary, ObjectSpec, Value

_OFF = 1 << 31
_EXTENDED = 1 << 29
_RECORDS = 4
_LAST_DUMMY = 0x1F
_MAPPING_OFFSET = 0x200
"""from a PDO's communication record to its mapping"""


@dataclass(frozen=True, slots=True)
class TransmitPdo:
    """A TPDO that is switched on."""

    number: int
    cob_id: int
    kind: int
    """transmission type, 1800+n:2"""
    period: float
    """event timer, s; 0: none"""
    statusword: bool
    """whether 6041 is in it, whose change is this drive's event"""
    pack: Callable[[], bytes]


@dataclass(frozen=True, slots=True)
class ReceivePdo:
    """An RPDO that is switched on."""

    cob_id: int
    kind: int
    size: int
    parts: tuple[tuple[ObjectSpec, slice], ...]


def transmit_pdos(dictionary: Dictionary) -> list[TransmitPdo]:
    """The TPDOs that 1800… and 1A00… describe and switch on."""
    found: list[TransmitPdo] = []
    for number in range(_RECORDS):
        record = 0x1800 + number
        cob_id = dictionary.number(record, 1, default=_OFF)
        if cob_id & _OFF:
            continue
        mapped = _mapped(dictionary, record + _MAPPING_OFFSET)
        specs = [spec for spec, _ in mapped if spec is not None]
        codes = [f"{size}x" if spec is None else spec.code for spec, size in mapped]
        found.append(
            TransmitPdo(
                number=number,
                cob_id=cob_id & 0x7FF,
                kind=dictionary.number(record, 2, default=255),
                period=1e-3 * dictionary.number(record, 5),
                statusword=any(spec.index == 0x6041 for spec in specs),
                pack=_packer(codes, [dictionary.reader(spec.key) for spec in specs]),
            )
        )
    return found


def receive_pdos(dictionary: Dictionary) -> list[ReceivePdo]:
    """The RPDOs that 1400… and 1600… describe and switch on."""
    found: list[ReceivePdo] = []
    for record in range(0x1400, 0x1400 + _RECORDS):
        cob_id = dictionary.number(record, 1, default=_OFF)
        if cob_id & _OFF:
            continue
        parts: list[tuple[ObjectSpec, slice]] = []
        offset = 0
        for spec, size in _mapped(dictionary, record + _MAPPING_OFFSET):
            if spec is not None:
                parts.append((spec, slice(offset, offset + size)))
            offset += size
        kind = dictionary.number(record, 2, default=255)
        found.append(ReceivePdo(cob_id & 0x7FF, kind, offset, tuple(parts)))
    return found


def guard_pdos(dictionary: Dictionary, changed: Callable[[int, int], None]) -> None:
    """Refuse what CiA 301 refuses, and call `changed` after what it allows.

    COB-ID: bits 0–30 only while the PDO is off. Mapping: only while it is off; entries only while subindex 0 is 0.
    """
    for base in (0x1400, 0x1800):
        for record in range(base, base + _RECORDS):
            dictionary.attach(record, guard=partial(_check_record, dictionary, record), watcher=changed)
            mapping = record + _MAPPING_OFFSET
            dictionary.attach(mapping, guard=partial(_check_mapping, dictionary, mapping), watcher=changed)


def _mapped(dictionary: Dictionary, mapping: int) -> list[tuple[ObjectSpec | None, int]]:
    """Entries with their bytes; None for one that only holds a place (a data type's index)."""
    found: list[tuple[ObjectSpec | None, int]] = []
    for subindex in range(1, dictionary.number(mapping, 0) + 1):
        entry = dictionary.number(mapping, subindex)
        spec = dictionary.find(entry >> 16, entry >> 8 & 0xFF)
        if entry >> 16 <= _LAST_DUMMY:
            found.append((None, (entry & 0xFF) // 8))
        elif not isinstance(spec, AbortCode) and spec.size is not None:
            found.append((spec, spec.size))
    return found


def _packer(codes: list[str], readers: list[Callable[[], Value]]) -> Callable[[], bytes]:
    pack = struct.Struct("<" + "".join(codes)).pack
    return lambda: pack(*[read() for read in readers])


def _check_record(dictionary: Dictionary, record: int, subindex: int, value: int) -> AbortCode | None:
    if subindex == 1:
        present = dictionary.number(record, 1)
        restricted = value & 0x7FF <= 0x80 or value & 0x7FF > 0x57F or value & _EXTENDED
        moved = not (present | value) & _OFF and present & 0x7FF != value & 0x7FF
        return AbortCode.VALUE if moved or (restricted and not value & _OFF) else None
    if subindex == 2 and 240 < value < 254:  # reserved, or on request by RTR, which this drive has not
        return AbortCode.VALUE
    return None


def _check_mapping(dictionary: Dictionary, mapping: int, subindex: int, value: int) -> AbortCode | None:
    if not dictionary.number(mapping - _MAPPING_OFFSET, 1) & _OFF:
        return AbortCode.UNSUPPORTED_ACCESS
    transmitted = mapping >= 0x1A00
    if subindex != 0:
        if dictionary.number(mapping, 0) != 0:
            return AbortCode.UNSUPPORTED_ACCESS
        return _check_entry(dictionary, value, transmitted=transmitted) if value else None
    bits = 0
    for position in range(1, value + 1):
        if isinstance(dictionary.find(mapping, position), AbortCode):
            return AbortCode.PDO_TOO_LONG
        entry = dictionary.number(mapping, position)
        refusal = _check_entry(dictionary, entry, transmitted=transmitted)
        if refusal is not None:
            return refusal
        bits += entry & 0xFF
    return AbortCode.PDO_TOO_LONG if bits > 64 else None


def _check_entry(dictionary: Dictionary, entry: int, *, transmitted: bool) -> AbortCode | None:
    spec = dictionary.find(entry >> 16, entry >> 8 & 0xFF)
    if isinstance(spec, AbortCode):
        return AbortCode.NO_OBJECT
    allowed = spec.readable if transmitted else spec.writable
    if not spec.mappable or not allowed or spec.size is None or 8 * spec.size != entry & 0xFF:
        return AbortCode.NOT_MAPPABLE
    return None
