"""The families of wrenches that are tried: what an unknown wrench may depend on, and where it may act.

Scales come from the motion as it was recorded (`Reach`), never from a campaign: centres within what was visited,
widths from a tenth of it up, speeds up to the highest seen.
"""

from fidim_lab.mismatch.unknown_force.by_place import brake, centre, evenly, in_space
from fidim_lab.mismatch.unknown_force.by_rate import of_cable, of_speed, of_spin, of_teeth
from fidim_lab.mismatch.unknown_force.by_time import in_time, knocks, moment, periodic
from fidim_lab.mismatch.unknown_force.family import Family
from fidim_lab.mismatch.unknown_force.points import ForcePoint
from fidim_lab.mismatch.unknown_force.reach import Reach


def families(reach: Reach, cables: int) -> tuple[Family, ...]:
    """All but the last, plainest first."""
    return (
        *of_speed(reach),
        *of_spin(reach),
        *(centre(reach, point) for point in ForcePoint),
        *(brake(reach, point) for point in ForcePoint),
        moment(reach),
        *periodic(reach),
        *evenly(reach),
        *in_space(reach),
        *in_time(reach),
        *(family for cable in range(1, cables + 1) for family in of_cable(cable)),
    )


def last_families() -> tuple[Family, ...]:
    """Those that take long to weigh: tried where none of the others does nearly all."""
    return (knocks(), *of_teeth())
