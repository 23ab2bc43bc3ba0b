"""The only place where units other than SI appear: at the edge, named by the unit."""

import math

HALL = 100.0
"""m: no hall is larger; the same number in mm is an everyday one"""


def millimetres(metres: float) -> float:
    """Metres to millimetres, for showing."""
    return metres * 1e3


def degrees(radians: float) -> float:
    """Radians to degrees, for showing."""
    return math.degrees(radians)


def percent(ratio: float) -> float:
    """A ratio to percent, for showing."""
    return ratio * 100.0


def plain(value: float, count: int = 3) -> str:
    """A number with so many figures, for tables: 0.00123, 2520, 12 — an exponent only outside of 1e-4 to 1e9."""
    text = f"{value:.{count}g}"
    if "e" not in text or not 1e-4 <= abs(value) < 1e9:
        return text
    return f"{float(text):.{max(count, 5)}f}".rstrip("0").rstrip(".") if abs(value) < 1 else f"{float(text):.0f}"


def signed(value: float, places: int) -> str:
    """A difference with its sign and so many decimals; without a sign where nothing is left of it."""
    text = f"{value:+.{places}f}"
    return text[1:] if not text.strip("+-0.") else text


NEWTON_FOR = {"N": 1.0, "kN": 1e3, "kg": 9.80665, "lbf": 4.4482216152605}
"""N for one unit of force as scales and load cells show it; kg is a kilogram's weight at standard gravity"""
RADIAN_FOR = {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180.0}
"""rad for one unit of angle"""
