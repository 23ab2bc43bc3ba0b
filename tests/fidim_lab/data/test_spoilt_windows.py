"""Window files and EDS files that are spoilt: refused in words, within time and memory, whatever their bytes."""

import struct
import time
from collections.abc import Callable
from pathlib import Path

import lz4.frame
import pytest
import zstandard
from google.protobuf import descriptor_pb2
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fidim_lab.data.files.mcap_file import CHUNK_LIMIT, read_mcap
from fidim_lab.data.window_csv import read_window_csv
from fidim_lab.data.window_mcap import read_window_mcap
from fidim_lab.errors import FileError

EACH_FOLDER = settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
ROWS = [f"{k / 100},0.1,0.2,0.3" for k in range(30)]


def _csv(header: str = "t,x,y,z", **changed: str) -> str:
    rows = [changed.get(f"r{k}", row) for k, row in enumerate(ROWS)]
    return "\n".join([header, *rows]) + "\n"


CSVS = {
    "many columns": ("t,x,y,z" + ",c" * 80_000, "80004 columns; at most 512"),
    "underscore": (_csv(r5="0.05,0.5_4,0,0"), "line 7, column x: '0.5_4' is not a number of digits 0 to 9"),
    "Arabic digits": (_csv(r5="0.05,٠.٥,0,0"), "line 7, column x: .* is not a number of digits 0 to 9"),
    "full-width digits": (_csv(r5="0.05,０,0,0"), "not a number of digits 0 to 9"),
    "infinity": (_csv(r5="0.05,infinity,0,0"), "not a finite number"),
    "1e400": (_csv(r5="0.05,1e400,0,0"), "not a finite number"),
    "1e300": (_csv(r5="0.05,1e300,0,0"), "not a measured value; at most 1e"),
    "long cell": (_csv(r5="0.05," + "1" * 200_000 + ",0,0"), "is not a finite number"),
    "NUL": (_csv(r5="0.05,\0\0,0,0"), r"'\\x00\\x00' is not a number"),
    "open quote": (_csv(r5='0.05,"1,0,0'), "is not a number"),
    "marker of 5000 digits": (_csv("t,x,y,m" + "9" * 5000 + "x"), "column z is missing"),
    "marker far away": (_csv("t,x,y,z,m99x,m99y,m99z"), "columns, the header has 7"),
    "name of a terminal": (_csv("t,x,y,z,\x1b[2J"), r"column '\\x1b\[2J' holds a control character"),
    "name read backwards": (_csv("t,x,y,z,\u202eabc"), "holds a control character or a direction mark"),
}


@pytest.mark.parametrize(("text", "says"), CSVS.values(), ids=list(CSVS))
def test_csv(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "w.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(FileError, match=says) as caught:
        read_window_csv(path, 4)
    assert len(str(caught.value)) < 500


@EACH_FOLDER
@given(st.text(st.sampled_from('0123456789.,-+eE_ "\n\r\t\0٣nai\x1b'), max_size=60), st.integers(0, 400))
def test_any_text_within_a_csv_is_read_or_refused(tmp_path: Path, put: str, at: int) -> None:
    path = tmp_path / "w.csv"
    whole = _csv()
    path.write_text(whole[:at] + put + whole[at:], encoding="utf-8", newline="")
    try:
        assert read_window_csv(path, 4).t.size >= 20
    except FileError as error:
        assert len(str(error)) < 500  # noqa: PT017 - both ends are right


def _record(opcode: int, body: bytes) -> bytes:
    return bytes([opcode]) + struct.pack("<Q", len(body)) + body


def _text(text: bytes) -> bytes:
    return struct.pack("<I", len(text)) + text


def _file(*records: bytes) -> bytes:
    magic = b"\x89MCAP0\r\n"
    end = _record(0x0F, struct.pack("<I", 0)) + _record(2, struct.pack("<QQI", 0, 0, 0)) + magic
    return magic + _record(1, _text(b"fidim-window/1") + _text(b"x")) + b"".join(records) + end


def _chunk(packed: bytes, says: int, compression: bytes = b"zstd") -> bytes:
    head = struct.pack("<QQQI", 0, 0, says, 0) + _text(compression) + struct.pack("<Q", len(packed))
    return _record(6, head + packed)


def _bomb(size: int) -> bytes:
    packer = zstandard.ZstdCompressor(level=1).compressobj()
    block = bytes(1 << 20)
    return b"".join([packer.compress(block) for _ in range(size >> 20)] + [packer.flush()])


MANY = zstandard.compress(bytes(1 << 20))
CHUNKS: dict[str, tuple[Callable[[], bytes], str]] = {
    "bomb that says so": (lambda: _file(_chunk(_bomb(128 << 20), 128 << 20)), "128 MiB; at most 8 MiB"),
    "bomb that says little": (lambda: _file(_chunk(_bomb(128 << 20), 1000)), "the 1000 bytes that it says"),
    "lz4 bomb": (lambda: _file(_chunk(lz4.frame.compress(bytes(1 << 24)), 99, b"lz4")), "the 99 bytes that it says"),
    "two to the 62": (lambda: _file(_chunk(MANY, 1 << 62)), "at most 8 MiB"),
    "zeros": (lambda: _file(*[_chunk(_bomb(CHUNK_LIMIT), CHUNK_LIMIT)] * 3), "fewer than 48 bytes"),
    "cut": (lambda: _file(_chunk(MANY[: len(MANY) // 2], 1 << 20)), "damaged"),
    "unknown packing": (lambda: _file(_chunk(b"abcd", 10, b"brotli")), "brotli"),
}


@pytest.mark.parametrize(("make", "says"), CHUNKS.values(), ids=list(CHUNKS))
def test_chunks(tmp_path: Path, make: Callable[[], bytes], says: str) -> None:
    path = tmp_path / "w.mcap"
    path.write_bytes(make())
    began = time.process_time()
    with pytest.raises(FileError, match=says) as caught:
        read_mcap(path, 64 << 20)
    assert time.process_time() - began < 5.0
    assert len(str(caught.value)) < 500


@pytest.mark.parametrize("kind", [1, 5, 9, 12])  # double, int32, string, bytes
@pytest.mark.parametrize("repeated", [False, True])
def test_rows_of_other_types(tmp_path: Path, kind: int, repeated: bool) -> None:
    files = descriptor_pb2.FileDescriptorSet()
    file = files.file.add(name="w.proto", package="fidim", syntax="proto3")
    row = file.message_type.add(name="WindowRow")
    for number, name in enumerate(("t", "markers", "lengths", "currents", "further"), start=1):
        row.field.add(name=name, number=number, type=kind, label=3 if repeated else 1)
    schema = _record(
        3, struct.pack("<H", 1) + _text(b"fidim.WindowRow") + _text(b"protobuf") + _text(files.SerializeToString())
    )
    channel = _record(4, struct.pack("<HH", 1, 1) + _text(b"/window") + _text(b"protobuf") + struct.pack("<I", 0))
    rows = [_record(5, struct.pack("<HIQQ", 1, k, k, k)) for k in range(30)]
    path = tmp_path / "w.mcap"
    path.write_bytes(_file(schema, channel, *rows))
    with pytest.raises(FileError, match=r"topic /window, (t|markers): is not"):
        read_window_mcap(path, 4)
