"""The raw log of motion capture: every datagram or piece of a byte stream with its arrival, in an MCAP file.

`PacketLog.write` is a tap of `StreamMarkerSource`; `read_packets` gives the packets back, also of a file cut off.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from drivers.disk import BlockFile
from drivers.ports import Disk
from fidim_lab.data.files.mcap_encoder import McapEncoder, nanoseconds
from fidim_lab.data.files.mcap_file import read_mcap

TOPIC = "/mocap/packets"
PROFILE = "fidim-packets/1"
_FLUSH_S = 0.09
_CONNECTION = 4
"""bytes before each packet: which connection it came by, little-endian"""


@dataclass(frozen=True)
class Packet:
    """One datagram, or piece of a stream."""

    t: float
    """monotonic s of arrival"""
    connection: int
    data: bytes


class PacketLog:
    """Writes every packet; flushed at 10 Hz of packet time, so that a killed process loses at most 0.1 s."""

    def __init__(self, path: Path, disk: Disk | None = None) -> None:
        """disk: takes the packets; whoever hands one over never waits. Raises FileError where it cannot be made."""
        self._file = BlockFile(path, "raw motion-capture log", disk)
        self._closed = False
        self._flushed_at = float("-inf")
        self._encoder = McapEncoder(profile=PROFILE)
        self._channel = self._encoder.add_channel(TOPIC, None, "application/octet-stream")

    @property
    def error(self) -> str | None:
        """Why writing ended (full disk); a tap must not raise, so whoever records has to look here."""
        return self._file.error

    def write(self, t: float, connection: int, data: bytes) -> None:
        """Append one packet; never raises."""
        if self.error is not None or self._closed:
            return
        packet = connection.to_bytes(_CONNECTION, "little") + data
        self._encoder.add(self._channel, nanoseconds(t), packet)
        if t - self._flushed_at >= _FLUSH_S:
            self._flushed_at = t
            self._file.put(self._encoder.flush())

    def close(self) -> None:
        """Write the index and close; may be called twice."""
        if not self._closed:
            self._closed = True
            self._file.put(self._encoder.finish())
            self._file.close()


def read_packets(path: Path) -> Iterator[Packet]:
    """The packets of a log, in order. Raises FileError for a file that is none, or damaged before its end."""
    for message in read_mcap(path).of(TOPIC):
        data: bytes = message.value
        yield Packet(message.log_time, int.from_bytes(data[:_CONNECTION], "little"), data[_CONNECTION:])
