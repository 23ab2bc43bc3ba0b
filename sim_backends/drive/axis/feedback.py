"""What the drive measures: encoder counts, speed, current; and what it concludes: following error, overload."""

import math

from sim_backends.drive.axis.defects import Defects
from sim_backends.drive.axis.make import PROFILE, Make
from sim_backends.drive.axis.positioner import Positioner
from sim_backends.drive.axis.profile import ShaftMotion
from sim_backends.drive.axis.shaft import Shaft
from sim_backends.drive.objects.dictionary import Dictionary

_WINDOW_OFF = 0xFFFFFFFF


class Feedback:
    """Measured values at the time last sampled, in the units of their objects.

    Current and torque are both the motor current, in per mille of 6075: a linear motor whose rated torque goes with its
    rated current. Without power there is none (the brake holds). Not simulated: speed ripple, dynamics of the sensors.
    """

    def __init__(
        self,
        dictionary: Dictionary,
        shaft: Shaft,
        positioner: Positioner,
        make: Make = PROFILE,
        defects: Defects | None = None,
    ) -> None:
        self._number = dictionary.number
        self._make = make
        self._defects = defects or Defects()
        self._frozen: int | None = None
        self._frozen_speed: int | None = None
        self._frozen_demand: int | None = None
        self._shaft = shaft
        self._positioner = positioner
        self._strayed_since: float | None = None
        self.now = 0.0
        """s, the present"""
        self.motion: ShaftMotion = positioner.motion(0.0)
        self.powered = False
        self.current_offset = 0.0
        """A that the ammeter reads too much"""
        self.stuck_current: int | None = None
        """what a stuck ammeter shows, per mille of 6075"""
        self.servo_lag = 0.0
        """s by which the shaft is behind the demand in motion"""
        self.slipped = 0
        """counts by which the encoder is off the shaft"""
        self.reference = 0
        """the same when power came: what the position loop believes"""

    def sample(self, t: float) -> None:
        """The present is t; time never goes back."""
        if t > self.now:
            self.now = t
        self.motion = self._positioner.motion(self.now)

    def power(self, on: bool) -> None:
        """The power stage is switched; switched on, the loop holds whatever the encoder shows."""
        if on and not self.powered:
            self.reference = self.slipped
        self.powered = on
        self._strayed_since = None

    def position(self) -> int:
        """6064, counts."""
        if not self._defects.encoder_frozen:
            return _wrap(self.motion.position + self.slipped)
        if self._frozen is None:
            self._frozen = _wrap(self.motion.position + self.slipped)
        return self._frozen

    def demand(self) -> int:
        """6062, counts."""
        ahead = self.servo_lag * self.motion.velocity
        demand = _wrap(self._positioner.demand(self.now).position + ahead + self.reference)
        if not self._defects.demand_frozen:
            return demand
        if self._frozen_demand is None:
            self._frozen_demand = demand
        return self._frozen_demand

    def velocity(self) -> int:
        """606C, counts/s or the maker's unit."""
        if not self._defects.speed_frozen:
            return _saturate(self.motion.velocity / self._make.velocity, 32)
        if self._frozen_speed is None:
            self._frozen_speed = _saturate(self.motion.velocity / self._make.velocity, 32)
        return self._frozen_speed

    def current(self) -> int:
        """6078 and 6077, per mille of the rated value."""
        if self.stuck_current is not None:
            return self.stuck_current
        return _saturate(1e3 * self._ampere() / self._rated(), 16)

    def vendor_current(self, ampere: float, bits: int) -> int:
        """The same in a maker's own object, of so many A for one digit."""
        stuck = self.stuck_current
        return _saturate((self._ampere() if stuck is None else 1e-3 * stuck * self._rated()) / ampere, bits)

    def _ampere(self) -> float:
        return (self._shaft.load_current if self.powered else 0.0) + self.current_offset

    def _rated(self) -> float:
        """A."""
        return 1e-3 * self._number(0x6075) or self._make.rated_current

    def lag(self) -> int:
        """60F4, following error, counts."""
        if not self._positioner.behind:
            off = self.reference - self.slipped + round(self.servo_lag * self.motion.velocity)
            return _wrap(off) if off else 0
        demand = self._positioner.demand(self.now).position + self.reference
        return _wrap(demand - self.motion.position - self.slipped)

    def lacking(self) -> float:
        """Sign of the torque that the load wants beyond 6073 or 6072; 0 where the motor can give it."""
        own = self._make.current_limit
        if own is not None:
            limit = own.ampere * self._number(own.index, own.sub, default=0xFFFFFFFF)
        else:
            most = min(self._number(0x6073, default=0xFFFF), self._number(0x6072, default=0xFFFF))
            limit = 1e-3 * self._rated() * most
        load = self._shaft.load_current
        return math.copysign(1.0, load) if abs(load) > limit else 0.0

    def strayed(self) -> bool:
        """Whether the following error is outside 6065."""
        window = self._number(0x6065, default=_WINDOW_OFF)
        if self._defects.following_error_ignored:
            return False
        return window != _WINDOW_OFF and self.powered and abs(self.lag()) > window

    def lost(self) -> bool:
        """Whether it has been so for longer than 6066 (asked once each tick)."""
        if not self.strayed():
            self._strayed_since = None
            return False
        if self._strayed_since is None:
            self._strayed_since = self.now
        return self.now - self._strayed_since >= 1e-3 * self._number(0x6066)


def _wrap(position: float) -> int:
    """Nearest count, as a 32-bit register shows it."""
    return (math.floor(position + 0.5) + 0x80000000 & 0xFFFFFFFF) - 0x80000000


def _saturate(value: float, bits: int) -> int:
    top = (1 << bits - 1) - 1
    return max(-top - 1, min(top, round(value)))
