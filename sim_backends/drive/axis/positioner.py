"""The way of the shaft: trapezoids to targets, ramps, the brake, and a motor too weak to follow.

Positions here are those of the shaft (counts, unquantised); `Feedback` turns them into what the encoder shows.
"""

import math

from sim_backends.drive.axis.defects import Defects
from sim_backends.drive.axis.make import PROFILE, Make
from sim_backends.drive.axis.profile import Profile, ShaftMotion, glide, standing, stop, trapezoid
from sim_backends.drive.axis.shaft import Shaft
from sim_backends.drive.objects.dictionary import Dictionary

QUICK_RAMP = 0x6085
"""quick stop deceleration"""
_SAGS, _LONG = 0.02, 60.0
"""turns of 10 000 counts a second at which a shaft sags behind an open brake, and s for which it does"""
_TEN_TIMES, _COASTING = 0.1, 0.02
"""of the deceleration: a ramp that is ten times too long, and a shaft that runs down"""
_BRAKE_TIME = 0.02
"""s that the holding brake takes to stop the shaft, whatever its speed"""


class Positioner:
    """Where the shaft is asked to be (demand) and where it is; one target may wait while another is under way.

    Not simulated: jerk limits (6086), blending of set-points (controlword bit 9). A motor whose load exceeds its
    current limit stands still until the load is less, then starts again from where it stands.
    """

    def __init__(
        self,
        dictionary: Dictionary,
        shaft: Shaft,
        position: float,
        make: Make = PROFILE,
        defects: Defects | None = None,
    ) -> None:
        self._dictionary = dictionary
        self._make = make
        self._defects = defects or Defects()
        self._shaft = shaft
        self._demand = self._actual = standing(position)
        self._waiting: float | None = None
        self._positioning = False
        self.target = position
        """the target under way or reached, counts"""
        shaft.follow(-math.inf, self._demand)

    def motion(self, t: float) -> ShaftMotion:
        """How the shaft moves at time t."""
        return self._actual.at(t)

    def demand(self, t: float) -> ShaftMotion:
        """How the profile wants the shaft to move at time t."""
        return self._demand.at(t)

    def at_rest(self, t: float) -> bool:
        """Whether no motion is under way or waiting, and the shaft is where it was wanted."""
        return t >= self._demand.end and self._waiting is None and self._actual is self._demand

    @property
    def behind(self) -> bool:
        """Whether the motor was too weak to follow, so that demand and shaft differ."""
        return self._actual is not self._demand

    @property
    def full(self) -> bool:
        """Whether a target waits, so that no other is taken."""
        return self._waiting is not None

    def aim(self, t: float, target: float, *, at_once: bool, start: bool) -> None:
        """A new target: now if `at_once` or nothing is under way, else after the present one.

        Without `start` it is only kept, for `resume`.
        """
        if start and not at_once and self._positioning and not self.at_rest(t):
            self._waiting = target
            return
        self._waiting = None
        if self._defects.wrong_direction:
            target = 2.0 * self._actual.at(t).position - target
        self.target = target
        if start:
            self.resume(t)

    @property
    def unlimited(self) -> bool:
        """A defect: position limits (607D) are ignored."""
        return self._defects.limit_ignored

    def resume(self, t: float) -> None:
        """Go to the target from wherever the shaft is, within 6081, 6083, 6084 and 607F, 60C5, 60C6."""
        number = self._dictionary.number
        speed = min(number(0x6081, default=1000), number(0x607F, default=0xFFFFFFFF)) * self._make.speed
        acceleration, deceleration = self._ramp(0x6083, 0x60C5), self._ramp(0x6084, 0x60C6)
        self._positioning = True
        self._follow(t, trapezoid(t, self._actual.at(t), self.target, speed, acceleration, deceleration))

    def run(self, t: float, limit: float, speed: float) -> None:
        """Towards `limit` (counts) at `speed` (counts/s), at most 607F, and stop there: profile velocity mode."""
        fastest = min(speed, self._dictionary.number(0x607F, default=0xFFFFFFFF) * self._make.speed)
        acceleration, deceleration = self._ramp(0x6083), self._ramp(0x6084)
        self._positioning, self._waiting, self.target = False, None, limit
        self._follow(t, trapezoid(t, self._actual.at(t), limit, fastest, acceleration, deceleration))

    def glide(self, t: float, target: float, period: float) -> None:
        """Straight to `target` (counts) within `period` (s), or as fast as 607F lets it: cyclic position mode."""
        if self._defects.wrong_direction:
            target = 2.0 * self._actual.at(t).position - target
        self._positioning, self._waiting, self.target = False, None, target
        position = self._actual.at(t).position
        fastest = max(self._dictionary.number(0x607F, default=0xFFFFFFFF), 1) * self._make.speed
        self._follow(t, glide(t, position, target, max(period, abs(target - position) / fastest)))

    def ramp_down(self, t: float, deceleration_object: int, *, keep_target: bool = False) -> None:
        """Stop with the deceleration in that object; the target is kept for `resume`, or forgotten."""
        self._positioning = False
        deceleration = float(self._ramp(deceleration_object))
        if self._defects.ramp_ten_times_too_long and deceleration_object == QUICK_RAMP:
            deceleration *= _TEN_TIMES
        if self._defects.halt_coasts and keep_target:
            deceleration *= _COASTING
        self._follow(t, stop(t, self._actual.at(t), deceleration))
        if not keep_target:
            self._forget()

    def brake(self, t: float) -> None:
        """Power goes, the brake closes; targets are forgotten."""
        if self._defects.brake_open:
            place = self._actual.at(t).position
            self._follow(t, glide(t, place, place + 1e4 * _SAGS * _LONG, _LONG))
        else:
            self._follow(t, self._braking(t))
        self._forget()

    def tick(self, t: float, lacking: float) -> None:
        """Every 5 ms. `lacking`: sign of the torque that the motor cannot give, 0 where it can."""
        if self._actual is not self._demand:
            if not lacking:
                self.resume(t)
        elif self._positioning and lacking and self._actual.at(t).velocity * lacking > 0.0:
            self._actual = self._braking(t)
            self._shaft.follow(t, self._actual)
        elif self._positioning and self._waiting is not None and t >= self._demand.end:
            self.target, self._waiting = self._waiting, None
            self.resume(t)

    def _ramp(self, index: int, limit: int | None = None) -> float:
        """counts/s² of a ramp; a drive without this object takes another of its ramps, a stop the profile's."""
        number = self._dictionary.number
        others = (0x6084, 0x6083) if index == 0x6085 else (0x6083,)
        digits = next((found for at in (index, *others) if (found := number(at)) > 0), 1)
        most = (number(limit) if limit else 0) or 0xFFFFFFFF
        if self._make.ramp_speed is not None:
            return 1e3 * self._make.ramp_speed / digits
        return min(digits, most) * self._make.acceleration

    def _braking(self, t: float) -> Profile:
        motion = self._actual.at(t)
        return stop(t, motion, max(abs(motion.velocity) / _BRAKE_TIME, 1.0))

    def _forget(self) -> None:
        self._positioning = False
        self._waiting = None
        self.target = self._demand.rest.position

    def _follow(self, t: float, profile: Profile) -> None:
        self._demand = self._actual = profile
        self._shaft.follow(t, profile)
