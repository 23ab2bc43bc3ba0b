"""What a maker does otherwise than the profile, as a simulated drive needs it: units, and where currents are."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Ampere:
    """An object of the maker's that holds a current."""

    index: int
    sub: int
    ampere: float
    """A for one digit"""


@dataclass(frozen=True)
class Make:
    """Without arguments the profile: counts, and per mille of 6075."""

    speed: float = 1.0
    """counts/s for one digit of 6081 and 607F"""
    velocity: float = 1.0
    """counts/s for one digit of 606C and 60FF"""
    acceleration: float = 1.0
    """counts/s² for one digit of 6083 to 6085"""
    ramp_speed: float | None = None
    """counts/s, where 6083 to 6085 hold the ms of a ramp to this speed in place of a slope"""
    rated_current: float = 1.0
    """A, where there is no 6075"""
    load: Ampere | None = None
    """in which it tells its current, beside 6078 and 6077"""
    current_limit: Ampere | None = None
    """in place of 6072 and 6073"""


PROFILE = Make()
