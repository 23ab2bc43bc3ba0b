"""The only place where units other than SI appear: at the edge, named by the unit."""

import math


def millimetres(metres: float) -> float:
    """Metres to millimetres, for showing."""
    return metres * 1e3


def degrees(radians: float) -> float:
    """Radians to degrees, for showing."""
    return math.degrees(radians)


def percent(ratio: float) -> float:
    """A ratio to percent, for showing."""
    return ratio * 100.0


NEWTON_FOR = {"N": 1.0, "kN": 1e3, "kg": 9.80665, "lbf": 4.4482216152605}
"""N for one unit of force as scales and load cells show it; kg is a kilogram's weight at standard gravity"""
RADIAN_FOR = {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180.0}
"""rad for one unit of angle"""
