"""What an effect that can be hidden is made of: its keys with unit and default, and whether it belongs to one cable."""

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Key:
    """One parameter of an effect."""

    default: float
    unit: str
    says: str


@dataclass(frozen=True)
class Kind:
    """What an effect may be given: its keys, and whether it belongs to one cable."""

    keys: Mapping[str, Key]
    one_cable: bool = False
    """it takes `cable=1…n` (without it: cable 1)"""
    any_cable: bool = False
    """it takes `cable=1…n`, and is meant for all cables without it"""


def xyz(prefix: str, defaults: tuple[float, float, float], unit: str, says: str) -> dict[str, Key]:
    """Three keys in a row, one for each axis."""
    return {prefix + axis: Key(value, unit, f"{says}, {axis}") for axis, value in zip("xyz", defaults, strict=True)}
