"""Raw logs: numbered for a resumed run, silent taps, a full disk said once and what it took kept."""

import errno
import os

import pytest

from drivers.canbus.candump import read_candump
from drivers.canbus.transport import CanFrame
from drivers.disk import InlineDisk
from drivers.mocap.packet_log import PacketLog, read_packets
from fidim_lab.errors import FileError
from procedures.recording.raw_logs import RawLogs, can_logs, packet_logs


def test_a_resumed_run_gets_further_files(tmp_path):
    for part in range(11):
        logs = RawLogs(tmp_path, InlineDisk())
        logs.on_frame(CanFrame(0x80, b"", 0.0))  # before it is open: not its matter
        logs.open()
        logs.on_frame(CanFrame(0x181, bytes([part]), float(part)))
        logs.on_packet(float(part), 1, bytes([part]))
        logs.close()
        logs.close()
        assert logs.error is None
    assert [path.name for path in can_logs(tmp_path)] == ["can.log", *(f"can-{k}.log" for k in range(2, 12))]
    assert [frame.data[0] for path in can_logs(tmp_path) for frame in read_candump(path)] == list(range(11))
    assert [packet.data[0] for path in packet_logs(tmp_path) for packet in read_packets(path)] == list(range(11))


def test_a_full_disk_under_the_packets(tmp_path):
    path = tmp_path / "mocap.mcap"
    log = PacketLog(path)
    for k in range(50):
        log.write(0.01 * k, 1, b"before")
    file, log._file._file = log._file._file, FullFile()
    for k in range(50, 100):
        log.write(0.01 * k, 1, b"after")
    log._file._file = file
    log.close()
    assert log.error == f"the raw motion-capture log {path} cannot be written: No space left on device"
    assert {packet.data for packet in read_packets(path)} == {b"before"}


class FullFile:
    """A file on a disk that has just become full."""

    closed = False

    def write(self, _data):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_a_folder_that_cannot_be_written(tmp_path):
    with pytest.raises(FileError, match="raw motion-capture log cannot be written"):
        PacketLog(tmp_path / "nowhere" / "mocap.mcap")
