"""The only place where units other than SI appear: at the edge, named by the unit."""

import math


def millimetres(metres: float) -> float:
    """Metres to millimetres, for showing."""
    return metres * 1e3


def metres_from_millimetres(value: float) -> float:
    """Millimetres (motion capture, drums) to metres."""
    return value * 1e-3


def degrees(radians: float) -> float:
    """Radians to degrees, for showing."""
    return math.degrees(radians)


def percent(ratio: float) -> float:
    """A ratio to percent, for showing."""
    return ratio * 100.0
