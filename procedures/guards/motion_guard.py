"""Uncommanded motion: a winch whose encoder differs from the last command, in place or in speed.

`Follower` compares one winch; the guard looks at all of them from the moment they get power, whatever the step, and
`procedures.teardown` proves each stop by the same comparison.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from drivers.ports import WinchSample
from drivers.trajectory import Trajectory
from procedures.guards.guard import Observation
from procedures.settings import GuardSettings, Reaction
from procedures.steps import Phase

OVERSHOOT = 0.25
"""part of the commanded speed by which a velocity loop may overshoot for a moment: a well-damped one stays under 0.2"""
MEMORY = 1.0
"""s in which a motion that the encoder does not show is forgotten: an offset of the drive's velocity counts for `place`
in a second (3 mm/s), a rounding to whole rpm of a motor with gear 10 and drum 30 mm is 0.2 mm/s"""


@dataclass(frozen=True)
class Tolerance:
    """How far a winch may be from its command."""

    place: float
    """m of cable, standing"""
    late: float = 0.0
    """s by which it may be early or late on its way: following error (place over speed), bus and drive cycles"""
    speed: float = math.inf
    """m/s, besides what is commanded"""
    lasting: float = 0.0
    """s for which the speed must be too high: encoders are differentiated, single values are noise"""

    @staticmethod
    def of(settings: GuardSettings) -> "Tolerance":
        """As the rig file says."""
        return Tolerance(settings.motion, settings.motion_late, settings.motion_speed, settings.motion_speed_for)


class Follower:
    """Compares one winch, sample by sample."""

    def __init__(self, tolerance: Tolerance) -> None:
        self._allowed = tolerance
        self._too_fast_since: float | None = None
        self._stop: Trajectory | None = None
        """the stop that it carries out"""
        self._behind = 0.0
        """m by which the first sample of that stop was off what was commanded"""
        self._last: WinchSample | None = None
        """before this one, at rest"""
        self._unseen = 0.0
        """m that the drive's velocity has told at rest and its encoder has not, lately"""

    @property
    def behind(self) -> float:
        """m by which the first sample of the stop that it carries out was off what was commanded."""
        return self._behind

    def look(self, sample: WinchSample | None, commanded: Trajectory | None) -> str:
        """The violation in words; empty where there is none, or nothing was commanded."""
        if sample is None or commanded is None:
            self._too_fast_since, self._last = None, None
            return ""
        if not self._follows(sample, commanded):
            return ""
        late = self._allowed.late
        seen = [commanded.at(sample.t + shift) for shift in (-late, 0.0, late)]
        places, speeds = [place for place, _ in seen], [speed for _, speed in seen]
        off = _outside(sample.length - self._behind, places)
        if abs(off) > self._allowed.place:
            return f"is {off * 1e3:+.1f} mm from its commanded position, {self._allowed.place * 1e3:g} mm is allowed"
        if self._turns_unseen(sample, resting=not any(speeds)):
            return f"moves at {sample.velocity:+.3f} m/s by its drive's velocity, and its encoder does not follow"
        beyond = abs(_outside(sample.velocity, speeds))
        if beyond <= self._allowed.speed + OVERSHOOT * max(map(abs, speeds)):
            self._too_fast_since = None
        elif self._too_fast_since is None:
            self._too_fast_since = sample.t
        elif sample.t - self._too_fast_since >= self._allowed.lasting:
            return f"moves at {sample.velocity:+.3f} m/s, {seen[1][1]:+.3f} m/s was commanded"
        return ""

    def _turns_unseen(self, sample: WinchSample, *, resting: bool) -> bool:
        """Whether a drum at rest turns by the drive's velocity (of its motor) and not by its encoder (of the drum)."""
        last, self._last = self._last, sample if resting else None
        if not resting or last is None:
            self._unseen = 0.0
        elif (elapsed := sample.t - last.t) > 0.0:
            told = 0.5 * (sample.velocity + last.velocity) * elapsed
            self._unseen = (self._unseen + told - (sample.length - last.length)) * math.exp(-elapsed / MEMORY)
        return abs(self._unseen) > self._allowed.place

    def _follows(self, sample: WinchSample, commanded: Trajectory) -> bool:
        """Whether a sample tells of this command. A stop in motion counts from the first one that does.

        It was commanded from an older sample; after a hang of this computer the drive may stand by itself for long.
        """
        if not (commanded.is_stop and commanded.velocity):
            self._stop, self._behind = None, 0.0
        elif sample.t <= commanded.t:
            return False
        elif commanded != self._stop:
            self._stop, self._behind = commanded, sample.length - commanded.at(sample.t)[0]
        return True


class MotionGuard:
    """A winch moves without a command, or not as it was commanded; from Enable to power-off, or in one phase only."""

    reaction = Reaction.QUICK_STOP

    def __init__(
        self, winches: Sequence[str], tolerance: Tolerance, name: str = "motion", only: Phase | None = None
    ) -> None:
        self.name = name
        self._winches = winches
        self._only = only
        self._followers = [Follower(tolerance) for _ in winches]

    def look(self, seen: Observation) -> str | None:
        """The first winch that is not where the last command has it."""
        if self._only is not None and seen.phase is not self._only:
            return None
        followed = zip(self._winches, self._followers, seen.winches, seen.commanded, strict=True)
        for winch, follower, sample, commanded in followed:
            if says := follower.look(sample, commanded):
                return f"{winch} {says}"
        return None


def _outside(value: float, between: Sequence[float]) -> float:
    """By how much a value is above or below all of several."""
    return value - min(max(value, min(between)), max(between))
