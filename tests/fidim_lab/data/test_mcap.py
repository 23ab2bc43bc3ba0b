"""MCAP windows: independent readers agree, what a crash leaves is never whole, damage is named, bytes are the same."""

import io
import tracemalloc

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from fidim_lab.data.files.mcap_encoder import CHUNK_SIZE, PACKED_BLOCK, McapEncoder, MessageSchema, nanoseconds
from fidim_lab.data.files.mcap_file import read_mcap
from fidim_lab.data.files.mcap_schemas import LOG, POSE, WINCH, messages, timestamp
from fidim_lab.data.window_csv import WindowColumns
from fidim_lab.data.window_mcap import read_unfinished, read_window_mcap, window_as_mcap
from fidim_lab.errors import FileError

N = 41


def columns(markers=2, cables=3, further=("temperature", "load")):
    rng = np.random.default_rng(1)
    places = rng.normal(size=(N, markers, 3))
    places[7] = np.nan
    more = {name: rng.normal(size=N) for name in further}
    return WindowColumns(np.arange(N) / 100.0, places, rng.normal(size=(N, cables)), rng.normal(size=(N, cables)), more)


@pytest.fixture(scope="module")
def whole() -> bytes:
    return window_as_mcap(columns())


def test_round_trip_to_the_bit(tmp_path, whole):
    path = tmp_path / "w.mcap"
    path.write_bytes(whole)
    back, made = read_window_mcap(path, 3), columns()
    for name in ("t", "markers", "lengths", "currents"):
        assert np.array_equal(getattr(back, name), getattr(made, name), equal_nan=True), name
    assert list(back.further) == ["temperature", "load"]
    assert np.array_equal(back.further["load"], made.further["load"])


def test_a_window_without_lengths_and_currents(tmp_path):
    made = columns(markers=1, further=())
    path = tmp_path / "w.mcap"
    path.write_bytes(window_as_mcap(WindowColumns(made.t, made.markers, None, None, {})))
    back = read_window_mcap(path, 3)
    assert back.lengths is None
    assert back.currents is None
    assert back.further == {}


def test_the_same_columns_give_the_same_bytes(whole):
    assert window_as_mcap(columns()) == whole


def test_the_mcap_library_reads_it_by_its_index(whole):
    """An independent reader: index, statistics, checksums, and the descriptors that the file carries itself."""
    reader = make_reader(io.BytesIO(whole), validate_crcs=True, decoder_factories=[DecoderFactory()])
    summary = reader.get_summary()
    assert summary.statistics.message_count == N
    assert {c.topic: c.message_encoding for c in summary.channels.values()} == {"/window": "protobuf"}
    rows = list(reader.iter_decoded_messages(topics=["/window"]))
    assert [row.decoded_message.row for row in rows] == list(range(N))
    assert [row.message.log_time for row in rows] == [nanoseconds(k / 100.0) for k in range(N)]
    assert np.array_equal(rows[3].decoded_message.markers, columns().markers[3].ravel())


def test_foxgloves_messages_have_its_field_numbers():
    """As foxglove-schemas has them: https://docs.foxglove.dev; on the wire, by hand."""
    pose = {"position": {"x": 1.0}, "orientation": {"w": 1.0}}
    data = messages().encode(POSE, timestamp=timestamp(1.5), frame_id="w", pose=pose)
    assert data.hex() == (
        "0a0808011080cab5ee01"  # 1: seconds 1, nanos 500 000 000
        + "120177"  # 2: "w"
        + "1a16"  # 3: pose
        + "0a09"
        + "09000000000000f03f"  # 1: position.x
        + "1209"
        + "21000000000000f03f"  # 2: orientation.w
    )
    log = messages().encode(LOG, timestamp=timestamp(0.0), level=4, message="m", name="n")
    assert log.hex() == "0a00" + "1004" + "1a016d" + "22016e"


def test_flush_brings_every_message_so_far_to_the_reader(tmp_path):
    encoder = McapEncoder()
    channel = encoder.add_channel("/winch/1", messages().schema(WINCH), "protobuf")
    path, data = tmp_path / "w.mcap.part", b""
    for k in range(30):
        encoder.add(channel, k, messages().encode(WINCH, cable=1, length=float(k)))
        if k % 10 == 9:
            data += encoder.flush()
            path.write_bytes(data)
            found = read_mcap(path)
            assert [m.value.length for m in found.of("/winch/1")] == [float(i) for i in range(k + 1)]
            assert not found.complete
            assert "without an end" in found.problem
    path.write_bytes(data + encoder.finish())
    assert read_mcap(path).complete


def test_a_chunk_is_closed_when_it_is_full():
    encoder = McapEncoder()
    channel = encoder.add_channel("/raw", None, "bytes", {"decoder": "x"})
    rng = np.random.default_rng(2)
    for k in range(10):
        encoder.add(channel, k, rng.bytes(CHUNK_SIZE // 4))
    data = encoder.finish()
    reader = make_reader(io.BytesIO(data), validate_crcs=True)
    assert len(reader.get_summary().chunk_indexes) == 3
    assert len(list(reader.iter_messages())) == 10


@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_cut_anywhere_it_is_unfinished_with_whole_rows_only(tmp_path, whole, data):
    path = tmp_path / "w.mcap.part"
    path.write_bytes(whole[: data.draw(st.integers(0, len(whole) - 1))])
    with pytest.raises(FileError):
        read_window_mcap(path, 3)
    contents = read_mcap(path)
    assert not contents.complete
    if contents.of("/window"):
        left = read_unfinished(path, 3)
        made = columns().markers[: len(left.columns.t)]
        assert np.array_equal(left.columns.markers, made, equal_nan=True)
        assert left.problem


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_a_damaged_byte_is_an_error_or_changes_no_value(tmp_path, whole, data):
    position = data.draw(st.integers(0, len(whole) - 1))
    damaged = bytearray(whole)
    damaged[position] ^= data.draw(st.integers(1, 255))
    path = tmp_path / "w.mcap"
    path.write_bytes(damaged)
    try:
        back = read_window_mcap(path, 3)
    except FileError:
        return
    assert np.array_equal(back.markers, columns().markers, equal_nan=True)
    assert np.array_equal(back.currents, columns().currents)


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.binary(max_size=300), st.booleans())
def test_any_bytes_are_read_or_refused(tmp_path, data, magic):
    path = tmp_path / "w.mcap"
    path.write_bytes(b"\x89MCAP0\r\n" * magic + data)
    with pytest.raises(FileError):
        read_window_mcap(path, 3)


def test_what_is_wrong_in_a_window_is_named(tmp_path):
    path = tmp_path / "w.mcap"

    def refused(data: bytes, match: str) -> None:
        path.write_bytes(data)
        with pytest.raises(FileError, match=match):
            read_window_mcap(path, 3)

    refused(window_as_mcap(columns(cables=4)), "4 values for a robot of 3 cables")
    made = columns()
    made.t[5] = made.t[4]
    refused(window_as_mcap(made), "row 6: time 0.04 s is not after 0.04 s")
    short = columns()
    refused(window_as_mcap(WindowColumns(short.t[:5], short.markers[:5], None, None, {})), "5 samples")
    encoder = McapEncoder()
    encoder.add(encoder.add_channel("/window", MessageSchema("x", "ros2msg", b""), "cdr"), 1, b"")
    refused(encoder.finish(), "encoded as 'cdr'")
    refused(b"t,x,y,z\n", "is not an MCAP file")
    with pytest.raises(FileError, match="no such file"):
        read_window_mcap(tmp_path / "none.mcap", 3)


def test_chunks_that_are_on_the_disk_cost_little_memory() -> None:
    """A recorder flushes ten times a second, all day."""
    encoder = McapEncoder()
    channel = encoder.add_channel("/raw", None, "bytes")

    def flushed(count: int) -> None:
        for k in range(count):
            encoder.add(channel, k, b"x" * 40)
            encoder.flush()

    flushed(100)
    tracemalloc.start()
    try:
        before, _ = tracemalloc.get_traced_memory()
        flushed(2000)
        after, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert (after - before) / 2000 < 40


def test_the_index_of_many_chunks_is_whole() -> None:
    """More of it than is compressed together."""
    encoder, count = McapEncoder(), 3 * PACKED_BLOCK // 80
    channel = encoder.add_channel("/raw", None, "bytes")
    data = b"".join([*(_added(encoder, channel, k) for k in range(count)), encoder.finish()])
    summary = make_reader(io.BytesIO(data), validate_crcs=True).get_summary()
    assert [chunk.message_start_time for chunk in summary.chunk_indexes] == list(range(count))
    assert summary.statistics.chunk_count == count


def _added(encoder: McapEncoder, channel: int, k: int) -> bytes:
    encoder.add(channel, k, b"x")
    return encoder.flush()
