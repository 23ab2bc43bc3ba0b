"""Numbers as the report writes them: as many digits as their uncertainty leaves, in units of a lab."""

import math

from fidim_lab.units import plain

MOST_DECIMALS = 5


def decimals(uncertainty: float | None) -> int:
    """How many decimals show two figures of an uncertainty; three where there is none."""
    if uncertainty is None or not uncertainty > 0 or not math.isfinite(uncertainty):
        return 3
    return min(max(1 - math.floor(math.log10(uncertainty)), 0), MOST_DECIMALS)


def fixed(value: float | None, places: int) -> str:
    """A value with so many decimals; a dash for nothing."""
    return "–" if value is None or math.isnan(value) else f"{value:.{places}f}"


def short(value: float | None, count: int = 3) -> str:
    """A value with so many figures; a dash for nothing."""
    return "–" if value is None or math.isnan(value) else plain(value, count)


def interval(value: float, uncertainty: float) -> str:
    """A value ± its uncertainty."""
    places = decimals(uncertainty)
    return f"{fixed(value, places)} ± {fixed(uncertainty, places)}"


def duration(seconds: float) -> str:
    """A stretch of time for people."""
    if seconds < 100:
        return f"{seconds:.3g} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest:02d} s"


def size(count: int) -> str:
    """A file's size for people."""
    return f"{count} B" if count < 1000 else f"{count / 1e3:.1f} kB" if count < 1e6 else f"{count / 1e6:.2f} MB"
