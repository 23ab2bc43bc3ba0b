"""What an effect that can be hidden is made of: its keys with unit and default, and whether it belongs to one cable."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

NOT_NEGATIVE = frozenset(("N s/m", "N s²/m²", "N s³/m³", "N m s", "kg m²", "kg/m", "kg", "Hz"))
"""units of damping, inertia, mass and frequency"""

FAR = 1e4
"""times the default of a parameter: beyond it is a slip of the unit or of the hand"""


@dataclass(frozen=True)
class Key:
    """One parameter of an effect."""

    default: float
    unit: str
    says: str
    low: float | None = None
    """what it may not be below; None: 0 where its unit says that less makes energy, or mass, out of nothing"""
    high: float = math.inf

    @property
    def highest(self) -> float:
        """The largest that can be meant: the default is what a laboratory may see, integrators follow no further."""
        return self.high if self.default == 0.0 else min(self.high, FAR * abs(self.default))

    @property
    def lowest(self) -> float:
        """The smallest value that can be meant."""
        bound = self.low if self.low is not None else 0.0 if self.unit in NOT_NEGATIVE else -math.inf
        return max(bound, -self.highest)


@dataclass(frozen=True)
class HiddenKind:
    """What an effect may be given: its keys, and whether it belongs to one cable."""

    keys: Mapping[str, Key]
    one_cable: bool = False
    """it takes `cable=1…n` (without it: cable 1)"""
    any_cable: bool = False
    """it takes `cable=1…n`, and is meant for all cables without it"""


def xyz(prefix: str, defaults: tuple[float, float, float], unit: str, says: str) -> dict[str, Key]:
    """Three keys in a row, one for each axis, of either sign."""
    return {
        prefix + axis: Key(value, unit, f"{says}, {axis}", low=-math.inf)
        for axis, value in zip("xyz", defaults, strict=True)
    }
