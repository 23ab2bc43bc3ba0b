"""Any dictionary, in any spelling that makers' tools and hands have: the same dictionary comes out."""

from dataclasses import dataclass

from hypothesis import given, settings
from hypothesis import strategies as st

from fidim_lab.data.eds import read_dictionary

NODE = 11
SIGNED = {2: 8, 3: 16, 4: 32, 0x15: 64}
UNSIGNED = {5: 8, 6: 16, 7: 32, 0x1B: 64}
NAMES = {2: "INTEGER8", 3: "Integer 16", 4: "INT32", 5: "UNSIGNED8", 6: "uint16", 7: "UNSIGNED_32", 0x15: "INTEGER64"}
ACCESS = {
    "ro": ("ro", "RO", "Read Only", "read-only", '"ro"'),
    "rw": ("rw", "RW", "r/w", "Read/Write", "read_write", "'rw'"),
    "wo": ("wo", "WO", "write only"),
    "rww": ("rww", "RWW"),
    "rwr": ("rwr", " rwr "),
    "const": ("const", "Const", "constant"),
}


@dataclass(frozen=True)
class Entry:
    """What one entry is, whatever its file looks like."""

    index: int
    sub: int | None
    """None: a variable"""
    kind: int
    access: str
    mapped: bool
    value: int | None
    by_node: bool
    """whether the value is a sum with the node's id"""


@st.composite
def dictionaries(draw: st.DrawFn) -> list[Entry]:
    """Some variables and records of vendor objects."""
    entries: list[Entry] = []
    for index in draw(st.lists(st.integers(0x2000, 0x5FFF), min_size=1, max_size=5, unique=True)):
        subs = draw(st.lists(st.integers(0, 0xFE), max_size=3, unique=True))
        for sub in [0, *(s for s in subs if s)] if subs else [None]:
            kind = draw(st.sampled_from([*SIGNED, *UNSIGNED]))
            bits = (SIGNED | UNSIGNED)[kind]
            low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if kind in SIGNED else (0, (1 << bits) - 1)
            by_node = kind == 7 and draw(st.booleans())
            value = draw(st.none() | st.integers(low, high)) if not by_node else draw(st.integers(0, high - NODE))
            entries.append(
                Entry(index, sub, kind, draw(st.sampled_from(list(ACCESS))), draw(st.booleans()), value, by_node)
            )
    return entries


@st.composite
def spelt(draw: st.DrawFn, entries: list[Entry]) -> bytes:
    """The file, in one of its spellings."""

    def one_of(*texts: str) -> str:
        return draw(st.sampled_from(texts))

    def number(value: int, bits: int | None = None) -> str:
        if value < 0:
            return one_of(str(value), f"0x{value & (1 << (bits or 32)) - 1:X}")
        body = one_of(f"{value}", f"0x{value:X}", f"0X{value:08x}", f"00{value}", f"0{value:x}h")
        return one_of(body, f" {body} ", f'"{body}"', f"{body} ; why", f"{body}  // why", f"{body} (why)")

    def with_node(value: int) -> str:
        word = one_of("$NODEID", "$NodeID", "NODEID", "{NODEID}", "$NODE_ID")
        return one_of(f"{word}+0x{value:X}", f"0x{value:x} + {word}", f"({word}+{value})", f"{word} + {value} + 0")

    def section(entry: Entry) -> str:
        name = one_of(f"{entry.index:04X}", f"0x{entry.index:04x}", f"{entry.index:04x}")
        if entry.sub is not None:
            name += one_of(f"sub{entry.sub:X}", f"Sub{entry.sub:02X}", f"SUB{entry.sub:x}", f" sub {entry.sub:X}")
        keys = {
            "ParameterName": one_of("a", "100 % [x] = y : z", "größe", "#1"),
            "ObjectType": one_of("7", "0x7", "0x07", "VAR"),
            "DataType": one_of(number(entry.kind), NAMES.get(entry.kind, str(entry.kind))),
            "AccessType": one_of(*ACCESS[entry.access]),
            "PDOMapping": one_of(str(int(entry.mapped)), "yes" if entry.mapped else "no", f"0x{int(entry.mapped)}"),
        }
        if entry.value is not None:
            bits = (SIGNED | UNSIGNED)[entry.kind]
            keys["DefaultValue"] = with_node(entry.value) if entry.by_node else number(entry.value, bits)
        parts = [
            f"{one_of('', ' ', chr(9))}{one_of(key, key.lower(), key.upper())}{one_of('=', ' = ', chr(9) + '=')}{text}"
            for key, text in draw(st.permutations(list(keys.items())))
        ]
        comment = one_of("", "; a comment\n", "\n", "# another\n")
        return f"{comment}[{one_of(name, f' {name} ')}]{one_of('', ' ; of it')}\n" + "\n".join(parts) + "\n"

    sections = [section(entry) for entry in entries]
    for index in sorted({entry.index for entry in entries if entry.sub is not None}):
        count = number(draw(st.integers(0, 300)))
        sections.append(
            f"[{index:04X}]\nParameterName=r\nObjectType={one_of('9', '0x8', 'RECORD')}\nSubNumber={count}\n"
        )
    text = one_of("", "; of somebody\n") + "\n".join(draw(st.permutations(sections)))
    text = text.replace("\n", one_of("\n", "\r\n", "\r"))
    return text.encode(one_of("utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "latin-1", "cp1252"))


@settings(max_examples=150)
@given(st.data())
def test_any_spelling_is_the_same_dictionary(tmp_path_factory, data):
    entries = data.draw(dictionaries())
    path = tmp_path_factory.mktemp("eds") / "x.dcf"
    path.write_bytes(data.draw(spelt(entries)))
    known = read_dictionary(path, NODE).dictionary
    for entry in entries:
        found = known[entry.index] if entry.sub is None else known[entry.index][entry.sub]
        value = None if entry.value is None else entry.value + (NODE if entry.by_node else 0)
        assert (found.data_type, found.access_type, found.pdo_mappable) == (entry.kind, entry.access, entry.mapped)
        assert found.default == value
    assert set(known.indices) == {entry.index for entry in entries}
