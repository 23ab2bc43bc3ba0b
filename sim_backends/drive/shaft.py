"""The mechanical port of a drive: the drive says how its shaft moves, the world says how hard that is."""

from typing import Protocol

from sim_backends.drive.profile import Profile, ShaftMotion, standing


class Shaft(Protocol):
    """What a simulated drive knows of the world."""

    @property
    def load_current(self) -> float:
        """A that the motor needs now, with the ammeter's noise; positive is torque towards increasing counts."""
        ...

    def follow(self, profile: Profile) -> None:
        """Move like this from now on, until told otherwise."""
        ...


class DrumShaft:
    """A shaft that follows its drive exactly, for a plant to read at any time.

    Not simulated: the servo loop (following is ideal and infinitely stiff), rotor inertia, gear play, drum compliance,
    and a load that overpowers motor or brake: without power a brake holds, the load never falls.
    """

    def __init__(self, position: float = 0.0) -> None:
        self._profile = standing(position)
        self._load_current = 0.0

    def motion(self, t: float) -> ShaftMotion:
        """Position, velocity and acceleration (counts, s) at a time not before the last command."""
        return self._profile.at(t)

    def set_load(self, current: float) -> None:
        """The plant's answer: motor current in A that carries the load; positive is torque towards more counts."""
        self._load_current = current

    @property
    def load_current(self) -> float:
        """As given by `set_load`."""
        return self._load_current

    def follow(self, profile: Profile) -> None:
        """Replace the motion (the drive calls this)."""
        self._profile = profile
