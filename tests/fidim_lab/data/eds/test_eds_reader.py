"""EDS files as makers ship them: what is repaired, where it is said, and what cannot be."""

import contextlib
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fidim_lab.data.eds import EdsFile, read_dictionary
from fidim_lab.errors import FileError

PLAIN = """\
[1000]
ParameterName=Device type
ObjectType=0x7
DataType=0x0007
AccessType=ro
PDOMapping=0
DefaultValue=0x20192
"""
NODE = 5


def variable(index: str, **keys: str) -> str:
    usual = {"ParameterName": "x", "ObjectType": "0x7", "DataType": "0x0007", "AccessType": "rw", "PDOMapping": "0"}
    return f"[{index}]\n" + "".join(f"{k}={v}\n" for k, v in (usual | keys).items()) + "\n"


@pytest.fixture
def read(tmp_path: Path) -> Callable[[str | bytes], EdsFile]:
    def reading(text: str | bytes) -> EdsFile:
        path = tmp_path / "drive.eds"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return read_dictionary(path, NODE)

    return reading


REPAIRED = {
    "empty PDOMapping": (variable("6040", PDOMapping=""), "[6040], line 6: PDOMapping '': taken as 0"),
    "binary": (variable("2000", DefaultValue="0b1100_0001"), "[2000], line 7: '0b1100_0001' is read as 193"),
    "leading zero": (variable("2000", DefaultValue="0012"), "[2000], line 7: '0012' is read as 12"),
    "doubled key": ("[2000]\nDataType=7\nDataType=6\n", "[2000], line 3: 'DataType' stands twice: the one in line 2"),
    "doubled section": (variable("2000") * 2, "[2000], line 8: stands twice: the one in line 1 counts"),
    "comment": (variable("2000", DataType="0x7 # UDINT"), "[2000], line 4: what follows # is taken as a comment"),
    "no parent": (variable("2000sub1"), "[2000sub1], line 1: has no section of its object above it: taken as a record"),
    "no sub 0": (variable("2000", ObjectType="9") + variable("2000sub1"), "[2000], line 1: has no sub-index 0: added"),
    "no type": (
        "[6040]\nParameterName=x\n",
        "[6040], line 1: DataType is missing: taken as type 0x06, as the standard",
    ),
    "no vendor type": ("[2000]\nParameterName=x\n", "DataType is missing: taken as bytes, which are not used"),
    "no access": ("[6064]\nParameterName=x\nDataType=4\n", "[6064], line 1: AccessType is missing: taken as ro"),
    "wrong sign": (variable("6064"), "[6064], line 4: DataType 0x07 has the wrong sign: 0x04 is meant"),
    "too large": (variable("2000", DefaultValue="0x1FFFFFFFF"), "'0x1FFFFFFFF' is not a value of its type: ignored"),
    "limits": (variable("2000", LowLimit="9", HighLimit="3"), "[2000], line 7: limits 9 to 3 leave no value"),
    "bracket": ("[2000 ; mine\nDataType=7\n", "[2000], line 1: the bracket is not closed"),
    "no pair": (f"{PLAIN}some words\n", "[1000], line 8: 'some words' is not KEY=VALUE: ignored"),
    "before it": (f"EDS of us\n{PLAIN}", "line 1: 'EDS of us' stands before the first section: ignored"),
    "NUL": (f"{PLAIN}\0", "line 8: bytes of 0: ignored"),
    "too many": (variable("2000", ObjectType="8", CompactSubObj="300"), "CompactSubObj=300: at most 254 are read"),
    "name of a type": (
        variable("2000", DataType="Unsigned 16"),
        "[2000], line 4: DataType 'Unsigned 16' is a name: 0x06",
    ),
    "quotes": (variable("2000", DataType='"7"'), "[2000], line 4: the quotes around the value are ignored"),
    "words behind": (variable("2000", DataType="0x7 (UDINT)"), "[2000], line 4: '0x7 (UDINT)' is read as 7"),
    "comment at once": (variable("2000", PDOMapping="1;yes"), "[2000], line 6: '1;yes' is read as 1"),
    "bare hexadecimal": (variable("2000", DefaultValue="00FF"), "[2000], line 7: '00FF' is read as 255"),
    "only listed": (
        PLAIN + "[OptionalObjects]\nSupportedObjects=1\n1=0x6040\n",
        "[OptionalObjects], line 10: 6040 is listed, and no section [6040] describes it: ignored",
    ),
    "variable with subs": (variable("2000") + variable("2000sub1"), "ObjectType says variable, but it has sub-indices"),
}


@pytest.mark.parametrize("case", REPAIRED)
def test_a_repair_is_said_once_with_section_and_line(read, case):
    text, says = REPAIRED[case]
    assert [says in str(repair) for repair in read(text).repairs].count(True) == 1


def test_a_file_as_it_should_be_needs_no_repair(read):
    found = read("[DeviceInfo]\nVendorName=We & Co\nProductName=D#1\n\n" + PLAIN)
    assert (found.vendor, found.product, found.repairs) == ("We & Co", "D#1", ())
    assert found.dictionary[0x1000].default == 0x20192


REFUSED = {
    "nothing": ("", "holds no objects"),
    "an archive": (b"PK\x03\x04" + bytes(range(256)), "line 1: holds no objects, nor any section"),
    "EtherNet/IP": (
        '[File]\nDescText = "x";\n[Device]\nVendCode = 1;\n',
        "[File], line 1: is an EDS of EtherNet/IP or DeviceNet and holds no objects",
    ),
    "no object": ("[FileInfo]\nFileName=x.eds\n[0005]\nDataType=5\n", "[FileInfo], line 1: holds no objects"),
    "XML": ('<?xml version="1.0"?>\n<Something/>', "line 1: is XML or a web page, no EDS file"),
    "contradiction": (
        variable("6040", DataType="6") + variable("6040", DataType="7"),
        "[6040], line 8: DataType 7, but 6 for the same object in line 1",
    ),
    "bomb": (
        "".join(variable(f"{i:04X}", ObjectType="8", CompactSubObj="254") for i in range(0x2000, 0x2100)),
        "[20EBsub4B], line 1881: there are more than 60000 entries",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_repaired_is_refused_with_section_line_and_cure(read, case):
    text, says = REFUSED[case]
    with pytest.raises(FileError) as caught:
        read(text)
    assert says in str(caught.value)
    assert caught.value.hint


@pytest.mark.parametrize("count", ["2000000000", "0x7FFFFFFF", "9" * 5000])
def test_counts_that_no_file_can_keep_cost_nothing(read, count):
    begun = time.process_time()
    lists = f"[Comments]\nLines={count}\n[2000Name]\nNrOfEntries={count}\n1=one\n"
    compact = variable("2000", ObjectType="8", CompactSubObj=count)
    assert read(PLAIN + lists + compact).dictionary[0x1000].default == 0x20192
    assert time.process_time() - begun < 2.0


def test_an_array_described_once_has_its_names_and_values(read):
    names = "[1016Name]\nNrOfEntries=2\n2=the host\n[1016Value]\nNrOfEntries=1\n1=0x7F00FA\n"
    array = read(variable("1016", ObjectType="8", CompactSubObj="2") + names).dictionary[0x1016]
    assert [array[sub].name for sub in (1, 2)] == ["x", "the host"]
    assert [array[sub].value for sub in (1, 2)] == [0x7F00FA, None]
    assert (array[0].default, len(array)) == (2, 3)


def test_a_type_that_canfestival_keeps_apart(read):
    assert read("[A0sub1]\nDefaultValue=6\n" + variable("2000", DataType="0xA0")).dictionary[0x2000].data_type == 6


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "latin-1"])
def test_encodings_of_editors(read, encoding):
    found = read(("; Größe\n" + variable("2000", ParameterName="Größe")).replace("\n", "\r\n").encode(encoding))
    assert found.dictionary[0x2000].name == "Größe"


SPELT = st.sampled_from(
    ["{}", "0x{:X}", "0X{:x}", " {} ", "00{}", "0x{:x} ; why", "0{:x}h", '"{}"', "0x{:X} (why)", "{};why", "0x{:x}UL"]
)
SUMS = st.sampled_from(
    [
        *("$NODEID+0x{:X}", "0x{:x}+$NODEID", "$NodeID + {}", "NODEID+0X{:X}", "($NODEID+{})", "$NODEID+0x{:X}+0"),
        *("{{NODEID}}+{}", "0x{:X} + ($Node_ID)", "$NODEID+0x{:X}+10-0xA", "0{:X}h+$NODEID"),
    ]
)


@pytest.mark.parametrize("text", ["0a000000000000000h", "0x00A000000000000000", "11529215046068469760"])
def test_sixty_four_bits_are_read_whole(read, text):
    assert read(variable("2000", DataType="0x1B", DefaultValue=text)).dictionary[0x2000].default == 0xA << 60


@given(value=st.integers(0, 2**31 - 1), spelt=SPELT)
def test_a_number_in_any_spelling(tmp_path_factory, value, spelt):
    path = tmp_path_factory.mktemp("eds") / "x.eds"
    path.write_text(variable("2000", DefaultValue=spelt.format(value)))
    assert read_dictionary(path, NODE).dictionary[0x2000].default == value


@given(value=st.integers(0, 2**31 - 1), spelt=SUMS)
def test_a_sum_with_the_node_in_any_spelling(tmp_path_factory, value, spelt):
    path = tmp_path_factory.mktemp("eds") / "x.eds"
    path.write_text(variable("2000", DefaultValue=spelt.format(value)))
    assert read_dictionary(path, NODE).dictionary[0x2000].default == value + NODE


@given(value=st.integers(-(2**31), 2**31 - 1))
def test_a_signed_value_as_hexadecimal(tmp_path_factory, value):
    path = tmp_path_factory.mktemp("eds") / "x.eds"
    path.write_text(variable("607D", DataType="4", DefaultValue=f"0x{value & 0xFFFFFFFF:08X}"))
    assert read_dictionary(path, NODE).dictionary[0x607D].default == value


@pytest.mark.parametrize(
    "sum_", ["$NODEID*2", "$NODEID+", "$NODEID+x", "$NODEID 0x180", "2-$NODEID", "$NODEID+$NODEID"]
)
def test_what_is_no_sum_is_passed_over(read, sum_):
    found = read(variable("2000", DefaultValue=sum_))
    assert found.dictionary[0x2000].default is None
    assert "is not a value of its type: ignored" in str(found.repairs[0])


def test_pdos_described_once_are_there(read):
    """As generators of masters write them: two of four RPDOs by themselves, the rest by CompactPDO."""
    info = "[DeviceInfo]\nNrOfRxPDO=4\nNrOfTxPDO=2\nCompactPDO=0x17\n"
    found = read(info + PLAIN + variable("1400", ObjectType="9") + variable("1400sub1", DefaultValue="0x205"))
    known = found.dictionary
    assert [index for index in range(0x1400, 0x1404) if index in known] == [0x1400, 0x1401, 0x1402, 0x1403]
    assert [sorted(known[index]) for index in (0x1400, 0x1401, 0x1800)] == [[0, 1], [0, 1, 2, 3, 5], [0, 1, 2, 3, 5]]
    assert known[0x1400][1].default == 0x205, "what has a section of its own counts"
    assert sorted(known[0x1A01]) == list(range(9))
    assert known[0x1A01][0].writable
    assert 0x1802 not in known


def test_a_file_is_read_anew_where_it_has_changed(tmp_path):
    path = tmp_path / "x.eds"
    for value in (1, 2):
        path.write_text(variable("2000", DefaultValue=str(value)))
        assert read_dictionary(path, NODE).dictionary[0x2000].default == value


def test_the_largest_file_is_read(read):
    """Drives with thousands of parameters: 25 000 entries, 3 MB."""
    rest = "ParameterName=p\nObjectType=7\nDataType=7\nAccessType=rw\nPDOMapping=0"
    one = "[{0:04X}sub{1:X}]\n{2}\nDefaultValue=0x{1:X}\n"
    text = "".join(one.format(index, sub, rest) for index in range(0x2000, 0x2000 + 1000) for sub in range(25))
    assert read(text).dictionary[0x2000 + 999][24].default == 24


LINES = st.one_of(
    st.sampled_from(
        [*PLAIN.splitlines(), *variable("1018sub1").splitlines(), "[1018]", "CompactSubObj=3", "[1A00Name]"]
    ),
    st.builds(
        "{}={}".format, st.sampled_from(["DataType", "ObjectType", "PDOMapping", "LowLimit"]), st.text(max_size=9)
    ),
    st.text(max_size=30),
)


@settings(max_examples=50)
@given(st.lists(LINES, max_size=40))
def test_any_lines_are_a_dictionary_or_a_file_error(tmp_path_factory, lines):
    path = tmp_path_factory.mktemp("eds") / "x.eds"
    path.write_text("\n".join(lines), encoding="utf-8", errors="replace")
    with contextlib.suppress(FileError):
        for repair in read_dictionary(path, NODE).repairs:
            assert 1 <= repair.line <= path.read_bytes().count(b"\n") + path.read_bytes().count(b"\r") + 1


@given(st.binary(max_size=300))
def test_any_bytes_are_a_dictionary_or_a_file_error(tmp_path_factory, data):
    path = tmp_path_factory.mktemp("eds") / "x.eds"
    path.write_bytes(data)
    with contextlib.suppress(FileError):
        assert read_dictionary(path, NODE).dictionary.indices


def test_a_name_behind_the_number_of_a_section_and_access_in_other_words(read):
    text = variable("6040 Controlword", DataType="6") + variable("0x2000sub1 - gain", AccessType="r/w/p")
    found = read(text + "[Dead zone]\nDataType=7\n").dictionary
    assert set(found.indices) == {0x2000, 0x6040}
    assert found[0x2000][1].access_type == "rw"


@pytest.mark.parametrize(
    ("default", "own", "value"),
    [("$NODEID+0x180", "0x187", None), ("$NODEID+0x180", "0x300", 0x300), ("0x180", "0x187", 0x187)],
)
def test_a_value_that_a_dcf_was_saved_with_for_another_node_is_this_nodes(read, default, own, value):
    """The tool of a maker writes the sum for the node of its own: it is no other identifier."""
    variable_ = read(variable("1800", DefaultValue=default, ParameterValue=own)).dictionary[0x1800]
    assert variable_.value == value
