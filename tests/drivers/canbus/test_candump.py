import contextlib
import errno
from io import FileIO
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.canbus.candump import CandumpLog, format_line, read_candump
from drivers.canbus.transport import CanFrame
from fidim_lab.errors import FileError

FRAMES = st.builds(
    CanFrame,
    id=st.integers(0, 0x7FF),
    data=st.binary(max_size=8),
    t=st.integers(0, 10**15).map(lambda us: us / 1e6),
) | st.builds(CanFrame, id=st.integers(0, 0x7FF), data=st.just(b""), t=st.just(1.0), remote=st.just(True))


def test_a_line_as_candump_writes_it() -> None:
    frame = CanFrame(0x181, bytes.fromhex("0011AABB"), 1436509052.249713)
    assert format_line(frame) == "(1436509052.249713) can0 181#0011AABB"
    assert format_line(CanFrame(0x80, b"", 1.5), "vcan1") == "(0000000001.500000) vcan1 080#"
    assert format_line(CanFrame(0x703, b"", 1.5, remote=True)) == "(0000000001.500000) can0 703#R"


@given(st.lists(FRAMES, max_size=30))
def test_round_trip(tmp_path_factory: pytest.TempPathFactory, frames: list[CanFrame]) -> None:
    path = tmp_path_factory.mktemp("log") / "can.log"
    with CandumpLog(path) as log:
        for frame in frames:
            log.write(frame)
    found = list(read_candump(path))
    assert [(f.id, f.data, f.remote) for f in found] == [(f.id, f.data, f.remote) for f in frames]
    assert [f.t for f in found] == pytest.approx([f.t for f in frames], abs=1e-6)


def test_a_log_that_was_cut_off_gives_what_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "can.log"
    path.write_text("(1.000000) can0 181#00\n\n(1.100000) can0 181#0", encoding="ascii")
    assert list(read_candump(path)) == [CanFrame(0x181, b"\0", 1.0)]


@pytest.mark.parametrize("line", ["hello", "(1.0) can0 181#0", "(1.0) can0 181#001122334455667788", "(1) can0 181#00"])
def test_a_line_that_is_none_is_named(tmp_path: Path, line: str) -> None:
    path = tmp_path / "can.log"
    path.write_text(f"(1.000000) can0 181#00\n{line}\n", encoding="ascii")
    with pytest.raises(FileError, match=r"can\.log: line 2: .*is not a candump line"):
        list(read_candump(path))


@given(st.binary(max_size=200))
def test_any_bytes_are_read_or_refused(tmp_path_factory: pytest.TempPathFactory, data: bytes) -> None:
    path = tmp_path_factory.mktemp("log") / "can.log"
    path.write_bytes(data)
    frames: list[CanFrame] = []
    with contextlib.suppress(FileError):
        frames.extend(read_candump(path))
    assert all(0 <= f.id <= 0x7FF and len(f.data) <= 8 for f in frames)
    assert len(frames) <= data.count(b"\n")


def test_lines_are_on_disk_while_the_bus_runs(tmp_path: Path) -> None:
    path = tmp_path / "can.log"
    log = CandumpLog(path)
    for k in range(100):
        log.write(CanFrame(0x80, b"", k * 0.01))
    assert len(path.read_text(encoding="ascii").splitlines()) >= 90
    log.close()
    log.close()
    log.write(CanFrame(0x80, b"", 2.0))
    assert len(path.read_text(encoding="ascii").splitlines()) == 100


class FullFile:
    """A file on a disk that has just become full."""

    def __init__(self, file: FileIO) -> None:
        self.name, self.close = file.name, file.close

    def write(self, _block: bytes) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")


def test_a_full_disk_never_reaches_the_receiver(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = CandumpLog(tmp_path / "can.log")

    with monkeypatch.context() as patch:
        patch.setattr(log._file, "_file", FullFile(log._file._file))  # pyright: ignore[reportPrivateUsage]
        for k in range(3):
            log.write(CanFrame(0x80, b"", float(k)))
    assert log.error is not None
    assert "No space left on device" in log.error
    log.close()


def test_a_folder_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="cannot be written"):
        CandumpLog(tmp_path / "no" / "can.log")
    with pytest.raises(FileError, match="no such file"):
        list(read_candump(tmp_path / "none.log"))
