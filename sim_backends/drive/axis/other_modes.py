"""Modes beside profile position: profile velocity (3) and torque (4), homing (6), cyclic synchronous position (8).

Each obeys the controlword's mode-specific bits and tells the statusword's. Written from the standard's text.
"""

from typing import Protocol

from sim_backends.drive.axis.feedback import Feedback
from sim_backends.drive.axis.make import PROFILE, Make
from sim_backends.drive.axis.positioner import Positioner
from sim_backends.drive.objects.dictionary import Dictionary

PROFILE_VELOCITY, PROFILE_TORQUE, HOMING, CYCLIC_POSITION = 3, 4, 6, 8
HOME_HERE = (35, 37)
"""homing methods that take the present position as home; 35 is the old number of 37"""
_REACHED, _BIT_12, _BIT_13 = 0x400, 0x1000, 0x2000
_START, _HALT = 0x10, 0x100


class MotionMode(Protocol):
    """What the axis asks of a mode while it is in OPERATION ENABLED."""

    def enter(self) -> None:
        """The mode begins, at standstill or on a stop ramp."""
        ...

    def control(self, word: int, previous: int) -> None:
        """Obey a controlword."""
        ...

    def target(self) -> None:
        """607A or 60FF was written."""
        ...

    def bits(self) -> int:
        """Mode-specific bits of the statusword."""
        ...


class _Mode:
    def __init__(
        self, dictionary: Dictionary, positioner: Positioner, feedback: Feedback, make: Make = PROFILE
    ) -> None:
        self._number = dictionary.number
        self._make = make
        self._positioner = positioner
        self._feedback = feedback

    def _limits(self) -> tuple[float, float]:
        """Of the shaft, counts, by 607D; both 0: none."""
        low, high = self._number(0x607D, 1, default=-(2**31)), self._number(0x607D, 2, default=2**31 - 1)
        if low >= high or self._positioner.unlimited:
            low, high = -(2**31), 2**31 - 1
        return float(low - self._feedback.reference), float(high - self._feedback.reference)


class ProfileVelocity(_Mode):
    """Ramps (6083, 6084) to 60FF, at most 607F, and stops at the position limits 607D. Halt stops on the ramp."""

    _halted = False

    def enter(self) -> None:
        """Nothing moves before a controlword or a new 60FF."""
        self._halted = True

    def control(self, word: int, previous: int) -> None:
        """Only the halt bit counts."""
        self._halted = bool(word & _HALT)
        self.target()

    def target(self) -> None:
        """Go at 60FF, as far as the limits allow."""
        wanted = 0 if self._halted else self._number(0x60FF)
        now = self._feedback.now
        if wanted == 0:
            self._positioner.ramp_down(now, 0x6084)
        else:
            self._positioner.run(now, self._limits()[wanted > 0], abs(wanted) * self._make.velocity)

    def bits(self) -> int:
        """10: at the target velocity; 12: stands."""
        velocity = self._feedback.motion.velocity
        wanted = 0 if self._halted else self._number(0x60FF)
        return (_REACHED if abs(velocity - wanted * self._make.velocity) < 1.0 else 0) | (
            _BIT_12 if velocity == 0.0 else 0
        )


class ProfileTorque(_Mode):
    """Turns at 607F towards the sign of 6071 as long as its load is less, and stands where it is not.

    Not simulated: the slope 6087, inertia, yielding to a load that is greater.
    """

    _halted = False

    def enter(self) -> None:
        """Nothing moves before a controlword."""
        self._halted = True

    def control(self, word: int, previous: int) -> None:
        """Only the halt bit counts."""
        self._halted = bool(word & _HALT)
        self.target()

    def target(self) -> None:
        """Look whether the load is less than the torque."""
        feedback, wanted = self._feedback, 0 if self._halted else self._number(0x6071)
        moving = feedback.motion.velocity != 0.0
        if wanted and abs(feedback.current()) < abs(wanted):
            if not moving:
                self._positioner.run(feedback.now, self._limits()[wanted > 0], self._number(0x607F))
        elif moving:
            self._positioner.ramp_down(feedback.now, 0x6085)

    def bits(self) -> int:
        """10: the torque is reached."""
        return _REACHED if self._feedback.motion.velocity == 0.0 else 0


class Homing(_Mode):
    """Bit 4 starts. Not simulated: methods that search for switches or index pulses (refused when 6098 is written)."""

    _attained = False
    _failed = False

    def enter(self) -> None:
        """Not homed since."""
        self._attained = self._failed = False

    def control(self, word: int, previous: int) -> None:
        """The rising edge of bit 4: 6064 is now 607C."""
        if not word & _START or previous & _START or word & _HALT:
            return
        self._failed = self._number(0x6098) not in HOME_HERE or self._feedback.motion.velocity != 0.0
        self._attained = not self._failed
        if self._attained:
            self._feedback.slipped = round(self._number(0x607C) - self._feedback.motion.position)
            self._feedback.reference = self._feedback.slipped

    def target(self) -> None:
        """No matter here."""

    def bits(self) -> int:
        """10 and 12: attained; 13: failed."""
        return (_REACHED | _BIT_12 if self._attained else 0) | (_BIT_13 if self._failed else 0)


class CyclicPosition(_Mode):
    """Goes to each new 607A in a straight line within 60C2, later at 607F; without a new one it stays at the last.

    Not simulated: interpolation beyond straight lines, extrapolation when a target is missing, 60B0 offsets.
    """

    def enter(self) -> None:
        """As real drives do: straight to what 607A happens to say."""
        self.target()

    def control(self, word: int, previous: int) -> None:
        """No bit of the mode's own; halt is not supported in this mode."""

    def target(self) -> None:
        """The next place."""
        low, high = self._limits()
        wanted = min(max(float(self._number(0x607A) - self._feedback.reference), low), high)
        period = self._number(0x60C2, 1) * 10.0 ** self._number(0x60C2, 2, default=-3)
        self._positioner.glide(self._feedback.now, wanted, max(period, 1e-3))

    def bits(self) -> int:
        """12: follows the command."""
        return 0 if self._positioner.behind else _BIT_12
