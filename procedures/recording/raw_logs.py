"""The raw bytes of a run, `raw/`: every CAN frame and motion-capture packet, so that a fault can become a test.

Make one for a run folder, hand `on_frame` and `on_packet` to the taps, `open` when the folder is there, let a
`LogGuard` look at `error`, `close` at the end. A resumed run gets further files: can-2.log, mocap-2.mcap.
"""

from pathlib import Path

from drivers.canbus.candump import CandumpLog
from drivers.canbus.transport import CanFrame
from drivers.mocap.packet_log import PacketLog
from drivers.ports import Disk

RAW = "raw"
CAN, MOCAP = "can", "mocap"


class RawLogs:
    """Both raw logs of one run; taps never raise."""

    def __init__(self, folder: Path, disk: Disk) -> None:
        """disk: takes what is logged."""
        self._folder = folder / RAW
        self._disk = disk
        self._frames: CandumpLog | None = None
        self._packets: PacketLog | None = None

    def open(self) -> None:
        """Begin to write: a job for the disk. Raises FileError or OSError where that cannot be."""
        self._folder.mkdir(exist_ok=True)
        number = 1 + len(can_logs(self._folder.parent))
        suffix = "" if number == 1 else f"-{number}"
        self._frames = CandumpLog(self._folder / f"{CAN}{suffix}.log", disk=self._disk)
        self._packets = PacketLog(self._folder / f"{MOCAP}{suffix}.mcap", self._disk)

    def on_frame(self, frame: CanFrame) -> None:
        """A tap of the bus."""
        if self._frames is not None:
            self._frames.write(frame)

    def on_packet(self, t: float, connection: int, data: bytes) -> None:
        """A tap of motion capture."""
        if self._packets is not None:
            self._packets.write(t, connection, data)

    @property
    def error(self) -> str | None:
        """Why a log is not whole."""
        return next((log.error for log in (self._frames, self._packets) if log is not None and log.error), None)

    def close(self) -> None:
        """Write what is left; may be called twice."""
        for log in (self._frames, self._packets):
            if log is not None:
                log.close()


def can_logs(folder: Path) -> tuple[Path, ...]:
    """The raw CAN logs of a run, in order."""
    return _numbered(folder, f"{CAN}*.log")


def packet_logs(folder: Path) -> tuple[Path, ...]:
    """The raw motion-capture logs of a run, in order."""
    return _numbered(folder, f"{MOCAP}*.mcap")


def _numbered(folder: Path, pattern: str) -> tuple[Path, ...]:
    return tuple(sorted((folder / RAW).glob(pattern), key=lambda path: (len(path.stem), path.stem)))
