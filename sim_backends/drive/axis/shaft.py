"""The mechanical port of a drive: the drive says how its shaft moves, the world says how hard that is."""

import math
from collections import deque
from typing import Protocol

from sim_backends.drive.axis.profile import Profile, ShaftMotion, standing

_REMEMBERED = 16
"""commands; what a plant may ask about lies at most a few cycles back"""


class Shaft(Protocol):
    """What a simulated drive knows of the world."""

    @property
    def load_current(self) -> float:
        """A that the motor needs now, with the ammeter's noise; positive is torque towards increasing counts."""
        ...

    def follow(self, t: float, profile: Profile) -> None:
        """Move like this from time t (s) on, until told otherwise."""
        ...


class DrumShaft:
    """A shaft that follows its drive exactly, for a plant to read at any time.

    Not simulated: the servo loop (following is ideal and infinitely stiff), rotor inertia, gear play, drum compliance,
    and a load that overpowers motor or brake: without power a brake holds, the load never falls.
    """

    def __init__(self) -> None:
        self._commands: deque[tuple[float, Profile]] = deque([(-math.inf, standing(0.0))], maxlen=_REMEMBERED)
        self._load_current = 0.0

    def motion(self, t: float) -> ShaftMotion:
        """Position, velocity and acceleration (counts, s) at t: exact, also a little before the last commands."""
        for since, profile in reversed(self._commands):
            if t >= since:
                return profile.at(t)
        return self._commands[0][1].at(t)

    def set_load(self, current: float) -> None:
        """The plant's answer: motor current in A that carries the load; positive is torque towards more counts."""
        self._load_current = current

    @property
    def load_current(self) -> float:
        """As given by `set_load`."""
        return self._load_current

    def follow(self, t: float, profile: Profile) -> None:
        """Replace the motion from t on (the drive calls this)."""
        self._commands.append((t, profile))
