"""What can go wrong with single frames on a simulated bus: rules that drop, delay, double or change them."""

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field

from drivers.canbus.transport import CanFrame


@dataclass(frozen=True)
class FrameRule:
    """What happens to frames with one of these identifiers, sent by anybody, on their way to everybody else.

    Several effects may be given at once. A real CAN bus has a checksum and repeats what was disturbed: a lost, late,
    doubled or changed frame stands for a full buffer, a slow adapter, a faulty gateway or a wrong device.
    """

    ids: frozenset[int]
    skip: int = 0
    """how many matching frames pass unharmed first"""
    count: int | None = None
    """how many are then affected; None: all"""
    drop: bool = False
    delay: float = 0.0
    """s"""
    copies: int = 1
    """how often it arrives"""
    change: Callable[[bytes], bytes] | None = None
    """new data (at most 8 bytes) from the data"""
    _seen: "itertools.count[int]" = field(default_factory=itertools.count, repr=False, compare=False)

    def applies(self, frame: CanFrame) -> bool:
        """Whether this frame is affected; counts it."""
        if frame.id not in self.ids:
            return False
        place = next(self._seen) - self.skip
        return place >= 0 and (self.count is None or place < self.count)
