"""An EDS file's bytes as sections of keys, each with its line. Nothing is understood yet, and little is refused."""

import codecs
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from fidim_lab.data.files.input_file import MIB, read_bytes
from fidim_lab.errors import FileError

LIMIT = 16 * MIB
"""bytes; the largest of a drive's maker that we know has 0.7 MiB, drives with thousands of parameters have some"""
_COMMENT = re.compile(r"(?:^|\s)(?:;|//).*$")
_OTHER_EDS = ("file", "device", "device classification", "params")
"""sections of the EDS files of EtherNet/IP and DeviceNet"""
_TEXTS = ("parametername", "vendorname", "productname")
"""keys whose value is a text: a hash in it is no comment"""


@dataclass(frozen=True)
class Repair:
    """One thing in a file that is not as the standard has it, and how it was taken."""

    section: str
    line: int
    what: str

    def __str__(self) -> str:
        place = f"[{self.section}], line {self.line}" if self.section else f"line {self.line}"
        return f"{place}: {self.what}"


@dataclass(frozen=True)
class Value:
    """What stands behind a key, without comment and blanks around it."""

    text: str
    line: int


@dataclass
class EdsSection:
    """One section; of a key that stands twice the first counts, as in every reader of INI files by Windows."""

    name: str
    line: int
    values: dict[str, Value] = field(default_factory=dict[str, Value])
    """by key in lower case"""

    def text(self, key: str) -> str:
        """The value of a key (lower case); empty where it has none."""
        value = self.values.get(key)
        return "" if value is None else value.text

    def at(self, key: str) -> int:
        """The line of a key, or of the section."""
        value = self.values.get(key)
        return self.line if value is None else value.line


def eds_bytes(path: Path) -> bytes:
    """The file. Raises FileError for none, or a large one."""
    return read_bytes(path, LIMIT)


def parse_sections(text: str) -> tuple[list[EdsSection], list[Repair]]:
    """All sections in their order, doubled ones as they stand."""
    sections: list[EdsSection] = []
    repairs: list[Repair] = []
    for number, raw in enumerate(text.splitlines(), start=1):
        line = raw.strip()
        if not line or line[0] in ";#":
            continue
        if line[0] == "[":
            name, closed, _ = line[1:].partition("]")
            sections.append(EdsSection(name.strip(), number))
            if not closed:
                sections[-1].name = _COMMENT.sub("", name).strip()
                repairs.append(Repair(sections[-1].name, number, "the bracket is not closed"))
        elif not sections:
            repairs.append(Repair("", number, f"{_short(line)} stands before the first section: ignored"))
        else:
            _take(sections[-1], line, number, repairs)
    return sections, repairs


def no_objects(path: Path, sections: Sequence[EdsSection]) -> FileError:
    """Why a file without objects is none of ours, and what to do."""
    known = next((s for s in sections if s.name.lower() in _OTHER_EDS), None)
    if known is not None:
        place, what = f"[{known.name}], line {known.line}", "is an EDS of EtherNet/IP or DeviceNet and holds no objects"
        return FileError(path, place, what, hint="Ask the drive's maker for its CANopen EDS.")
    if sections:
        place = f"[{sections[0].name}], line {sections[0].line}"
        return FileError(path, place, "holds no objects", hint="An EDS has sections such as [1000] and [1018sub1].")
    hint = "Is it a link, an archive, or an empty download? An EDS has sections such as [1000] and [1018sub1]."
    return FileError(path, "line 1", "holds no objects, nor any section", hint=hint)


def decoded(data: bytes) -> tuple[str, list[Repair]]:
    """The encodings of makers' editors; nothing that counts is beyond ASCII."""
    repairs: list[Repair] = []
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        text = data.decode("utf-16", "replace")
        repairs.append(Repair("", 1, "the text is UTF-16"))
    elif data.count(0) > len(data) // 4:
        text = data.decode("utf-16-le" if data[1:2] == b"\0" else "utf-16-be", "replace")
        repairs.append(Repair("", 1, "the text is UTF-16 without a mark"))
    else:
        try:
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = data.decode("latin-1")
    if "\0" in text:
        line = text.count("\n", 0, text.index("\0")) + 1
        repairs.append(Repair("", line, "bytes of 0: ignored"))
        text = text.replace("\0", "")
    lines = text.replace("\r\n", "\n").replace("\r", "\n")
    return re.sub(r"[\v\f\x1c-\x1e\x85\u2028\u2029]", " ", lines), repairs  # splitlines would count them


def _take(section: EdsSection, line: str, number: int, repairs: list[Repair]) -> None:
    parted = re.match(r"([^=:]*?)\s*[=:]\s*(.*)$", line)
    if parted is None:
        repairs.append(Repair(section.name, number, f"{_short(line)} is not KEY=VALUE: ignored"))
        return
    key = re.sub(r"\s", "", parted[1])
    value = _COMMENT.sub("", parted[2]).strip()
    if len(value) > 1 and value[0] == value[-1] and value[0] in "\"'":
        value = value[1:-1].strip()
        repairs.append(Repair(section.name, number, "the quotes around the value are ignored"))
    if key.lower() not in _TEXTS and "#" in value:
        value = value.partition("#")[0].strip()
        repairs.append(Repair(section.name, number, "what follows # is taken as a comment"))
    old = section.values.get(key.lower())
    if old is None:
        section.values[key.lower()] = Value(value, number)
    else:
        repairs.append(Repair(section.name, number, f"{_short(key)} stands twice: the one in line {old.line} counts"))


def _short(text: str) -> str:
    return repr(text if len(text) <= 30 else f"{text[:29]}…")
