"""XDD and XDC files (CiA 311): the same objects as in an EDS or DCF, as XML. They become its sections, line by line.

What stands at an object counts before its parameter (`uniqueIDRef`) and that before the parameter's template. Nothing
outside the file is read, and entities of its own (`<!ENTITY`) are refused.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from fidim_lab.data.eds.text import EdsSection, Value
from fidim_lab.errors import FileError

_ROOT = "ISO15745ProfileContainer"
_OTHERS = {
    "EtherCATInfo": "describes a drive for EtherCAT (ESI)",
    "IODevice": "describes a device for IO-Link (IODD)",
    "GSDML": "describes a device for PROFINET (GSDML)",
}
"""root elements of what makers ship beside it"""
_KEYS = {
    "name": "parametername",
    "objectType": "objecttype",
    "accessType": "accesstype",
    "lowLimit": "lowlimit",
    "highLimit": "highlimit",
    "defaultValue": "defaultvalue",
    "actualValue": "parametervalue",
}
"""attribute of an object → key of its section"""
_TYPES = {
    "BOOL": "0x01",
    **{"SINT": "0x02", "INT": "0x03", "DINT": "0x04", "LINT": "0x15"},
    **{"USINT": "0x05", "UINT": "0x06", "UDINT": "0x07", "ULINT": "0x1B"},
    **{"BYTE": "0x05", "WORD": "0x06", "DWORD": "0x07", "LWORD": "0x1B"},
    **{"REAL": "0x08", "LREAL": "0x11", "STRING": "0x09"},
}
"""element of a parameter → its type"""
_ACCESS = {"read": "ro", "write": "wo", "readWrite": "rw", "readWriteInput": "rwr", "readWriteOutput": "rww"}
_VALUES = {
    "defaultValue": "defaultvalue",
    "actualValue": "parametervalue",
    "minValue": "lowlimit",
    "maxValue": "highlimit",
}
"""elements of a parameter that have an attribute `value`"""


def is_xml(text: str) -> bool:
    """Whether a file is no text of sections at all."""
    return text.lstrip().startswith("<")


def xml_sections(path: Path, text: str) -> list[EdsSection]:
    """Sections of a CANopen description. Raises FileError for XML of another kind, or with a mistake in it."""
    reading = _Reading()
    parser = expat.ParserCreate("utf-8")
    parser.StartElementHandler = lambda name, given: reading.begin(_local(name), given, parser.CurrentLineNumber)
    parser.EndElementHandler = lambda name: reading.end(_local(name))
    parser.CharacterDataHandler = reading.characters

    def declares(*_: object) -> None:
        raise FileError(
            path,
            f"line {parser.CurrentLineNumber}",
            "declares entities of its own",
            hint="Have the maker's tool save an EDS, or delete <!DOCTYPE …>.",
        )

    parser.EntityDeclHandler = declares
    try:
        parser.Parse(text.lstrip().encode("utf-8", "replace"), True)
    except expat.ExpatError as error:
        if reading.root not in (_ROOT, *_OTHERS):
            raise _no_description(path) from error
        what = f"is not well-formed XML: {expat.errors.messages[error.code]}"
        hint = "Download it again, or have the maker's tool save it."
        raise FileError(path, f"line {error.lineno}", what, hint=hint) from error
    if (known := _OTHERS.get(reading.root)) is not None:
        raise FileError(path, "line 1", known, hint="Ask the drive's maker for its CANopen EDS or XDD.")
    if reading.root != _ROOT:
        raise _no_description(path)
    if not reading.objects:
        what = "is an XDD file without CANopen objects (another network's, or only a part of one)"
        raise FileError(path, "", what, hint="Ask the drive's maker for its CANopen EDS or XDD.")
    return reading.sections()


def _no_description(path: Path) -> FileError:
    hint = "Download the raw file of a web page; else ask the drive's maker for its CANopen EDS or XDD."
    return FileError(path, "line 1", "is XML or a web page, no EDS file", hint=hint)


@dataclass
class _Element:
    """An object, a sub-object or a parameter."""

    line: int
    given: Mapping[str, str]
    values: dict[str, Value] = field(default_factory=dict[str, Value])

    def put(self, key: str, text: str, line: int) -> None:
        """The first counts."""
        self.values.setdefault(key, Value(text.strip(), line))


class _Reading:
    """What has been met on the way through a file."""

    def __init__(self) -> None:
        self.root = ""
        self.objects: list[tuple[str, _Element]] = []
        """name of the section, and the element"""
        self._parameters: dict[str, _Element] = {}
        self._parameter: _Element | None = None
        self._index = ""
        self._text: list[str] | None = None
        self._info: dict[str, str] = {}

    def begin(self, name: str, given: Mapping[str, str], line: int) -> None:
        """An element opens."""
        self.root = self.root or name
        self._text = [] if name in ("vendorName", "productName") else None
        if name in ("CANopenObject", "CANopenSubObject"):
            self._object(name, given, line)
        elif name in ("parameter", "parameterTemplate"):
            self._parameter = self._parameters[given.get("uniqueID", "")] = _Element(line, given)
            if "access" in given:
                self._parameter.put("accesstype", _ACCESS.get(given["access"], given["access"]), line)
        elif self._parameter is not None:
            self._of_parameter(self._parameter, name, given, line)

    def end(self, name: str) -> None:
        """An element closes."""
        if self._text is not None:
            self._info.setdefault(name.lower(), "".join(self._text).strip())
            self._text = None
        if name in ("parameter", "parameterTemplate"):
            self._parameter = None

    def characters(self, text: str) -> None:
        """What stands between tags."""
        if self._text is not None:
            self._text.append(text)

    def sections(self) -> list[EdsSection]:
        """All of them, with maker and product in front."""
        info = {key: Value(text, 1) for key, text in self._info.items()}
        described = [EdsSection(name, one.line, self._whole(one)) for name, one in self.objects]
        return [EdsSection("DeviceInfo", 1, info), *described]

    def _object(self, name: str, given: Mapping[str, str], line: int) -> None:
        if name == "CANopenObject":
            self._index = given.get("index", "")
            section = self._index
        else:
            section = f"{self._index}sub{given.get('subIndex', '')}"
        element = _Element(line, given)
        for attribute, key in _KEYS.items():
            if attribute in given:
                element.put(key, given[attribute], line)
        if given.get("dataType"):
            element.put("datatype", f"0x{given['dataType']}", line)
        if "PDOmapping" in given:
            mapped = given["PDOmapping"].strip().lower() in ("default", "optional", "tpdo", "rpdo")
            element.put("pdomapping", str(int(mapped)), line)
        self.objects.append((section, element))

    @staticmethod
    def _of_parameter(parameter: _Element, name: str, given: Mapping[str, str], line: int) -> None:
        if name in _VALUES and "value" in given:
            parameter.put(_VALUES[name], given["value"], line)
        elif name in _TYPES:
            parameter.put("datatype", _TYPES[name], line)

    def _whole(self, element: _Element) -> dict[str, Value]:
        """With what its parameter says, and the template of that."""
        found, step, seen = dict(element.values), element, set[str]()
        while True:
            other = step.given.get("uniqueIDRef") or step.given.get("templateIDRef") or ""
            if other in seen or other not in self._parameters:
                return found
            seen.add(other)
            step = self._parameters[other]
            found = {**step.values, **{key: value for key, value in found.items() if value.text}}


def _local(name: str) -> str:
    """Without the prefix of a name space."""
    return name.rpartition(":")[2]
