"""The running step of a run: the engine's only mutable state, read by guards and listeners."""

from procedures.guards.guard import Trip
from procedures.steps import Phase, Step


class Pulse:
    """What is true of the run now."""

    def __init__(self) -> None:
        self.step: Step | None = None
        self.number = 0
        self.left = 0.0
        """estimated s, at the begin of the step"""
        self.told = -1.0
        """when progress was last told"""
        self.touched = False
        """whether any command may have reached a winch"""
        self.trip: Trip | None = None
        """latched: no step begins after it"""
        self.paused = False
        self.begun = 0.0
        """when the step began"""
        self.spoiled: dict[str, str] = {}
        """window → what a guard found while it was recorded; until it is judged"""

    @property
    def phase(self) -> Phase:
        """What the robot is allowed to do. Someone who pauses a run may walk to the robot and stand before a camera."""
        if self.paused:
            return Phase.HANDLING
        return self.step.phase if self.step else Phase.PREPARING
