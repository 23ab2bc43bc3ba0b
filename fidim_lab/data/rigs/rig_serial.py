"""Serial devices of a rig: the release and measuring devices, as the rig file states them, in SI units."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum


class Loading(StrEnum):
    """Who brings the platform to the release."""

    BY_HAND = "by-hand"
    """a person, who is asked for it"""
    BY_ITSELF = "by-itself"
    """the device pulls it there when it is told to hold; nobody is asked"""


@dataclass(frozen=True)
class ReleaseEntry:
    """The device that holds the displaced platform and lets it go."""

    port: str
    baud: int
    hold: bytes
    release: bytes
    ask: bytes
    holds: str
    """the line that answers `ask` while it holds"""
    released: str
    loading: Loading
    period: float
    """s between two questions"""
    timeout: float
    """s within which a command must be confirmed, and after which an answer is too old"""
    watchdog: float
    """s without a question until the device lets go by itself; what the simulated one does"""

    @property
    def name(self) -> str:
        """For messages."""
        return f"release {self.port}"


@dataclass(frozen=True)
class GaugeEntry:
    """A measuring device that sends lines of text."""

    what: str
    """load cells or inclinometer"""
    port: str
    baud: int
    pattern: str
    """of a line, see `drivers.serial_line.template`"""
    scale: float
    """SI units for one unit on the wire"""
    offset: float
    """SI, added to every number"""
    rate: float
    """lines a second, Hz"""
    age: float
    """s after which a reading is unknown"""
    uncertainty: float
    """SI, standard deviation of a reading's error"""
    ask: bytes = b""
    """what makes the device send one line; empty where it sends by itself"""
    columns: Mapping[str, str] = field(default_factory=dict[str, str])
    """name of a number in the pattern → column of a window"""

    @property
    def name(self) -> str:
        """For messages."""
        return f"{self.what} {self.port}"
