"""XDD and XDC files: the built-in dictionary, written as XML in the ways of makers' tools, is the same dictionary."""

import re
from collections.abc import Callable
from pathlib import Path
from xml.sax.saxutils import quoteattr

import pytest

from drivers.cia402.dictionary import GENERIC_EDS
from fidim_lab.data.eds import read_dictionary
from fidim_lab.data.eds.text import EdsSection, decoded, parse_sections
from fidim_lab.errors import FileError

NODE = 5
TYPES = {2: "SINT", 3: "INT", 4: "DINT", 5: "USINT", 6: "UINT", 7: "UDINT", 9: "STRING"}
ACCESS = {"ro": "read", "wo": "write", "rw": "readWrite", "const": "const"}
ACCESS |= {"rwr": "readWriteInput", "rww": "readWriteOutput"}
HEAD = '<?xml version="1.0" encoding="UTF-8"?>\n'


def number(text: str) -> int:
    return int(text or "7", 0)


def at_the_object(name: str, section: EdsSection) -> tuple[dict[str, str], str]:
    mapped = "optional" if section.text("pdomapping") == "1" else "no"
    told = {
        "dataType": f"{number(section.text('datatype')):04X}",
        "accessType": section.text("accesstype"),
        "defaultValue": section.text("defaultvalue"),
        "PDOmapping": mapped,
    }
    return told, ""


def by_a_parameter(name: str, section: EdsSection) -> tuple[dict[str, str], str]:
    """As Motion Manager writes it: type, access and value stand in a list of their own, with a value of now."""
    mapped = "default" if section.text("pdomapping") == "1" else "no"
    value = quoteattr(section.text("defaultvalue"))
    parameter = (
        f'<parameter uniqueID="P{name}" access="{ACCESS[section.text("accesstype")]}"><label lang="en">x</label>'
        f"<{TYPES[number(section.text('datatype'))]}/><defaultValue value={value}/></parameter>\n"
    )
    return {"uniqueIDRef": f"P{name}", "PDOmapping": mapped}, parameter


def xdd(describe: Callable[[str, EdsSection], tuple[dict[str, str], str]], prefix: str = "") -> str:
    sections, _ = parse_sections(decoded(GENERIC_EDS.read_bytes())[0])
    tree: dict[str, list[str]] = {}
    parameters = ""
    for section in sections:
        if (found := re.fullmatch(r"([0-9A-F]{4})(?:sub([0-9A-F]+))?", section.name)) is None:
            continue
        attributes = {"subIndex": found[2].zfill(2)} if found[2] else {"index": found[1]}
        attributes |= {"name": section.text("parametername"), "objectType": str(number(section.text("objecttype")))}
        if section.text("datatype"):
            told, parameter = describe(section.name, section)
            attributes |= told
            parameters += parameter
        tree.setdefault(found[1], []).append(" ".join(f"{k}={quoteattr(v)}" for k, v in attributes.items()))
    objects = "\n".join(
        f"<{prefix}CANopenObject {own}>{''.join(f'<{prefix}CANopenSubObject {sub}/>' for sub in subs)}"
        f"</{prefix}CANopenObject>"
        for own, *subs in tree.values()
    )
    space = f"xmlns{':' + prefix[:-1] if prefix else ''}="
    return (
        f'{HEAD}<{prefix}ISO15745ProfileContainer {space}"http://www.canopen.org/xml/1.0">\n'
        f"<{prefix}DeviceIdentity><{prefix}vendorName>Us &amp; Co</{prefix}vendorName>"
        f"<{prefix}productName>Drive</{prefix}productName></{prefix}DeviceIdentity>\n{parameters}{objects}\n"
        f"</{prefix}ISO15745ProfileContainer>\n"
    )


WAYS = {
    "at the object": xdd(at_the_object).encode(),
    "by a parameter": xdd(by_a_parameter).encode(),
    "with a prefix": xdd(at_the_object, "co:").encode(),
    "UTF-16": xdd(at_the_object).encode("utf-16"),
    "another encoding": xdd(at_the_object).replace("UTF-8", "gb2312").replace("Us ", "Üs ").encode("latin-1"),
    "blank lines before it": b"\n\n" + xdd(at_the_object).encode(),
}


@pytest.mark.parametrize("way", WAYS)
def test_an_xdd_is_the_same_dictionary(tmp_path, way):
    path = tmp_path / "drive.xdd"
    path.write_bytes(WAYS[way])
    found, wanted = read_dictionary(path, NODE), read_dictionary(GENERIC_EDS, NODE).dictionary
    assert found.product == "Drive"
    assert found.vendor.endswith("s & Co")
    assert set(found.dictionary.indices) == set(wanted.indices)
    for entry in wanted.values():
        own = found.dictionary[entry.index]
        pairs = [(own, entry)] if not hasattr(entry, "subindices") else [(own[n], entry[n]) for n in entry.subindices]
        for mine, other in pairs:
            assert (mine.name, mine.data_type, mine.access_type) == (other.name, other.data_type, other.access_type)
            assert bool(mine.pdo_mappable) == bool(other.pdo_mappable)
            assert mine.default == other.default or {mine.default, other.default} <= {None, "", 0}


def only(objects: str) -> str:
    return f"{HEAD}<ISO15745ProfileContainer>\n{objects}\n</ISO15745ProfileContainer>"


def test_limits_templates_and_values_of_another_node(tmp_path):
    path = tmp_path / "drive.xdc"
    path.write_text(
        only(
            '<parameterTemplate uniqueID="T" access="readWrite"><UDINT/><minValue value="1"/><maxValue value="9"/>'
            '</parameterTemplate>\n<parameter uniqueID="P" templateIDRef="T"><actualValue value="7"/></parameter>\n'
            '<CANopenObject index="2000" name="x" objectType="7" uniqueIDRef="P" dataType=""/>\n'
            '<CANopenObject index="1014" name="x" objectType="7" dataType="0007" accessType="ro" '
            'defaultValue="$NODEID+0x80" actualValue="135"/>'
        ),
        encoding="utf-8",
    )
    dictionary = read_dictionary(path, NODE).dictionary
    own = dictionary[0x2000]
    assert (own.data_type, own.access_type, own.min, own.max, own.value) == (7, "rw", 1, 9, 7)
    assert (dictionary[0x1014].default, dictionary[0x1014].value) == (0x80 + NODE, None)


REFUSED = {
    "POWERLINK": (only('<Object index="1000"/>'), "is an XDD file without CANopen objects"),
    "EtherCAT": ("<EtherCATInfo/>", "line 1: describes a drive for EtherCAT (ESI)"),
    "a web page": ("<!DOCTYPE html><html><p>404</html>", "line 1: is XML or a web page, no EDS file"),
    "cut off": (xdd(at_the_object)[:2000], "is not well-formed XML: unclosed token"),
    "entities": (HEAD + '<!DOCTYPE x [<!ENTITY a "b">]><x/>', "line 2: declares entities of its own"),
    "no index": (only('<CANopenObject name="x"/>'), "holds no objects"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_canopen_description_is_refused_with_cure(tmp_path: Path, case):
    text, says = REFUSED[case]
    path = tmp_path / "drive.xdd"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(FileError) as caught:
        read_dictionary(path, NODE)
    assert says in str(caught.value)
    assert caught.value.hint
