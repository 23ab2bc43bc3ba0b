"""`read_dictionary`: an EDS file, repaired in memory, as the object dictionary of the `canopen` library."""

import io
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from canopen.objectdictionary import ObjectDictionary
from canopen.objectdictionary.eds import import_eds

from fidim_lab.data.eds.objects import clean_objects
from fidim_lab.data.eds.text import Repair, decoded, eds_bytes, parse_sections
from fidim_lab.data.eds.xdd import is_xml, xml_sections
from fidim_lab.errors import FileError


@dataclass(frozen=True, eq=False)
class EdsFile:
    """What a file describes, and what had to be repaired to read it. Shared by all who read it: nobody changes it."""

    path: Path
    vendor: str
    product: str
    """as the file has them; empty where it does not"""
    dictionary: ObjectDictionary
    repairs: tuple[Repair, ...]


def read_dictionary(path: Path, node_id: int) -> EdsFile:
    """The dictionary in an EDS or DCF file, `$NODEID` resolved.

    Raises FileError with section, line and cure for what cannot be repaired: no object at all, one whose type stands
    twice and differs, a file that is none.
    """
    return _read(path, eds_bytes(path), node_id)


@lru_cache(maxsize=16)
def _read(path: Path, data: bytes, node_id: int) -> EdsFile:
    """Kept for who asks again: a rig asks twice for each winch, and the largest files take seconds."""
    content, repairs = decoded(data)
    if is_xml(content):
        sections = xml_sections(path, content)
    else:
        sections, found = parse_sections(content)
        repairs += found
    text, more = clean_objects(path, sections)
    info = next((s for s in sections if s.name.lower() == "deviceinfo"), None)
    try:
        dictionary = import_eds(io.StringIO(text), node_id)
    except Exception as error:  # canopen raises whatever its parser meets
        raise FileError(path, "", f"is not an EDS file: {error}", hint="Please report this file.") from error
    vendor, product = ("", "") if info is None else (info.text("vendorname"), info.text("productname"))
    return EdsFile(path, vendor, product, dictionary, tuple(sorted((*repairs, *more), key=lambda r: r.line)))
