"""Network management (NMT) and heartbeat, CiA 301. Pure."""

from dataclasses import dataclass
from enum import IntEnum


class NmtCommand(IntEnum):
    """First byte of frame 0x000."""

    START = 0x01
    STOP = 0x02
    PRE_OPERATIONAL = 0x80
    RESET_NODE = 0x81
    RESET_COMMUNICATION = 0x82


class NmtState(IntEnum):
    """The state of a node in its heartbeat."""

    BOOT_UP = 0x00
    STOPPED = 0x04
    OPERATIONAL = 0x05
    PRE_OPERATIONAL = 0x7F

    @property
    def words(self) -> str:
        """For messages."""
        return self.name.replace("_", "-")


@dataclass(frozen=True)
class Heartbeat:
    """One heartbeat (or boot-up) message."""

    t: float
    """monotonic s of arrival"""
    state: NmtState


def decode_heartbeat(data: bytes, t: float) -> Heartbeat | None:
    """A frame 0x700 + node id; None where it is malformed. The toggle bit of old node guarding is ignored."""
    if len(data) != 1:
        return None
    try:
        return Heartbeat(t, NmtState(data[0] & 0x7F))
    except ValueError:
        return None


def nmt_frame(command: NmtCommand, node_id: int) -> bytes:
    """Data of frame 0x000."""
    return bytes((command, node_id))


def heartbeat_frame() -> bytes:
    """Data of the host's own heartbeat: it is always operational while it lives."""
    return bytes((NmtState.OPERATIONAL,))
