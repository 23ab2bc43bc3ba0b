"""What a file describes once for many: arrays (CompactSubObj), PDOs (CompactPDO); and a sub-index 0 that it omits."""

from collections.abc import Iterator, Mapping
from dataclasses import replace

from fidim_lab.data.eds.numbers import number
from fidim_lab.data.eds.text import EdsSection, Value

_COUNTED = (0x1003, *range(0x1600, 0x1800), *range(0x1A00, 0x1C00))
"""whose sub-index 0 is written"""
_DIRECTIONS = {"nrofrxpdo": (0x1400, 0x1600), "nroftxpdo": (0x1800, 0x1A00)}
"""key of [DeviceInfo] → communication and mapping object of the first PDO"""
_COMMUNICATION = ("COB-ID", "transmission type", "inhibit time", "reserved", "event timer", "SYNC start value")
_MOST_PDOS = 512
_ENTRIES = 8
"""of a mapping: a byte each"""


def compact_entry(index: int, sub: int, parent: EdsSection, lists: Mapping[str, EdsSection]) -> EdsSection:
    """One entry of an array that its file describes once for all (CompactSubObj), with its own name and value."""
    values = {key: value for key, value in parent.values.items() if key not in ("objecttype", "compactsubobj")}
    for key, listed in (("parametername", lists.get("name")), ("parametervalue", lists.get("value"))):
        if listed is not None and (own := listed.values.get(str(sub))) is not None:
            values[key] = own
    return replace(parent, name=f"{index:04X}sub{sub:X}", values=values)


def count_of(index: int, highest: int, parent: EdsSection, subs: Mapping[int, EdsSection]) -> EdsSection:
    """A sub-index 0 that the file leaves out."""
    written = index in _COUNTED and any("w" in s.text("accesstype").lower() for s in subs.values())
    return _section(index, 0, parent.line, "Number of entries", 0x05, "rw" if written else "ro", str(highest))


def compact_pdos(info: EdsSection) -> Iterator[tuple[int, dict[int, EdsSection]]]:
    """Objects of the PDOs that [DeviceInfo] counts and CompactPDO describes: its bit n − 1 is sub-index n of 14xx.

    Yields index and entries, sub-index 0 left out.
    """
    told, line = number(info.text("compactpdo")) or 0, info.at("compactpdo")
    for key, (communication, mapping) in _DIRECTIONS.items():
        pdos = number(info.text(key)) or 0 if told else 0
        for k in range(min(max(pdos, 0), _MOST_PDOS)):
            subs = {n: name for n, name in enumerate(_COMMUNICATION, start=1) if told >> n - 1 & 1}
            kinds = {n: 0x07 if n == 1 else 0x06 if n in (3, 5) else 0x05 for n in subs}
            yield (
                communication + k,
                {n: _section(communication + k, n, line, name, kinds[n]) for n, name in subs.items()},
            )
            entries = range(1, _ENTRIES + 1)
            yield mapping + k, {n: _section(mapping + k, n, line, f"entry {n}", 0x07) for n in entries}


def _section(
    index: int, sub: int, line: int, name: str, kind: int, access: str = "rw", default: str = ""
) -> EdsSection:
    texts = {"parametername": name, "datatype": f"0x{kind:02X}", "accesstype": access, "defaultvalue": default}
    return EdsSection(f"{index:04X}sub{sub:X}", line, {key: Value(text, line) for key, text in texts.items()})
