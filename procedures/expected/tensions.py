"""A cable's tension at rest with its uncertainty: by its load cell where it has one, else by motor current.

Friction of gear and drum carries a part of the load, in a direction that the winch's last move tells: after paying out
the motor carries less than the cable pulls, after winding more. With the direction known only the scatter is left.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from procedures.outcomes import Measurement
from procedures.settings import TensionBand

SIGMAS = 2.0
"""standard deviations of a load cell's error that count as its band"""


@dataclass(frozen=True)
class KnownTension:
    """A cable's tension within ± band, both N; a band of None: not measured, the robot's limits are widened instead."""

    value: float
    band: float | None
    source: str


def by_current(tension: float, moved: int, band: TensionBand | None) -> KnownTension:
    """From gain · I + offset (N) and the direction of the last move: +1 paid out, −1 wound, 0 unknown.

    T = (gain · I + offset + D · friction) / (1 − D · load_friction), within the scatter (`calibrate` fits these).
    """
    if band is None:
        return KnownTension(tension, None, "motor current")
    if band.scatter is None:  # a band as a whole, from a calibration that knew no directions
        return KnownTension(tension, band.friction, "motor current")
    if moved == 0:
        unknown = band.friction + band.load_friction * abs(tension)
        return KnownTension(tension, band.scatter + unknown, "motor current, last direction unknown")
    value = (tension + moved * band.friction) / (1.0 - moved * band.load_friction)
    return KnownTension(value, band.scatter, f"motor current after {'paying out' if moved > 0 else 'winding'}")


def current_for(tension: float, band: TensionBand | None) -> float:
    """gain · I + offset (N) by which a winch that winds pulls with a tension (N): `by_current` the other way."""
    if band is None:
        return tension
    return tension * (1.0 + band.load_friction) + (0.0 if band.scatter is None else band.friction)


def known_tensions(
    currents: Sequence[float],
    moved: Sequence[int],
    bands: Sequence[TensionBand] | None,
    cells: Mapping[int, tuple[float, float]],
) -> tuple[KnownTension, ...]:
    """One for each cable. currents: gain · I + offset, N; cells: reading and uncertainty (N) by cable, from 1."""
    found: list[KnownTension] = []
    for cable, (tension, direction) in enumerate(zip(currents, moved, strict=True), start=1):
        reading, uncertainty = cells.get(cable, (math.nan, 0.0))
        if math.isfinite(reading):
            found.append(KnownTension(reading, SIGMAS * uncertainty, "load cell"))
        else:
            found.append(by_current(tension, direction, None if bands is None else bands[cable - 1]))
    return tuple(found)


def measured(cable: int, known: KnownTension, limits: tuple[float, float], tolerance: float) -> Measurement:
    """A tension against its limits (N): PASS where it is certainly within them, MARGINAL where it may be, else FAIL.

    Without a measured band: marginal beyond a limit, failed beyond its tolerance, as ever.
    """
    low, high = limits
    if known.band is None:
        margin = low * tolerance
        return Measurement(
            f"tension of cable {cable}",
            known.value,
            "N",
            low=low * (1 - tolerance),
            high=high * (1 + tolerance),
            margin=margin,
        )
    name = f"tension of cable {cable} (± {known.band:.1f} N by {known.source})"
    return Measurement(name, known.value, "N", low=low - known.band, high=high + known.band, margin=2.0 * known.band)
