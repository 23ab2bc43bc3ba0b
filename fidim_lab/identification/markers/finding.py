"""A finding of screening: a record with window, channel, times, size and a sentence."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from jaxtyping import Float

AXES = "xyz"


class DefectKind(StrEnum):
    """The kind of defect of the samples."""

    CLOCK = "clock"
    """time stamps are uneven, or not those of the sample rate"""
    GAP = "gap"
    """samples are missing, and the file says so: no fault, only fewer data"""
    SKIP = "skip"
    """frames were lost, but the time stamps go on as if they were not"""
    FROZEN = "frozen"
    """the same values again and again"""
    SPIKE = "spike"
    """single samples far away from their neighbours"""
    JUMP = "jump"
    """a step that no acceleration of the mechanism makes"""
    NOISE = "noise"
    """more or less noise than the robot file declares"""


FAULTS = frozenset({DefectKind.SKIP, DefectKind.FROZEN, DefectKind.SPIKE, DefectKind.JUMP})
"""kinds that bend a fit: their samples are taken out"""


@dataclass(frozen=True)
class Finding:
    """One thing that the samples themselves show, before any model."""

    kind: DefectKind
    window: str | None
    """its id; None where it holds for the whole campaign"""
    channel: str
    """as in the file's header: x, m2y, l3, i1, t"""
    t: tuple[float, float] | None
    """s on the window's own clock, first and last sample concerned"""
    size: float
    """in `unit`"""
    unit: str
    says: str
    """a sentence for people"""

    @property
    def is_fault(self) -> bool:
        """True where a fit would be bent by it."""
        return self.kind in FAULTS


def marker_channel(marker: int, axis: int) -> str:
    """The file's name of a marker coordinate: x, y, z for the main marker, m2x … for the others (0-based index)."""
    return AXES[axis] if marker == 0 else f"m{marker + 1}{AXES[axis]}"


def marker_name(marker: int) -> str:
    """The name for people."""
    return "the marker" if marker == 0 else f"marker {marker + 1}"


def marker_jump(
    window: str, marker: int, by: Float[np.ndarray, "3"], t: tuple[float, float], *, digits: int, sign: str
) -> Finding:
    """A marker (0-based) is displaced by so much (m) between two times (s); the sign is what tells that it is.

    digits: of the first of them, in the sentence.
    """
    size, axis = float(np.linalg.norm(by)), int(np.argmax(np.abs(by)))
    says = (
        f"Window {window}: {marker_name(marker)} jumps by {size * 1e3:.3g} mm (mostly {AXES[axis]}) at "
        f"{t[0]:.{digits}f} s{sign}"
    )
    return Finding(DefectKind.JUMP, window, marker_channel(marker, axis), t, size, "m", says)
