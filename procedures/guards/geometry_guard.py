"""Markers against encoders at all times: a drum that turns behind an encoder that does not show it.

An encoder may be frozen in place and speed; cameras are not. The platform swings and is displaced by hand, so rest is
not assumed. But no cable is longer than it is, and one whose motor pulls is not shorter, either: whatever the platform
does, the markers must fit the lengths told, as well as they did where both were compared last.
"""

from collections.abc import Callable, Sequence

import numpy as np

from drivers.ports import MarkerFrame
from fidim_lab.arrays import Mask, PerCable, Positions, Vector3
from fidim_lab.data.records import Pose, Robot
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.misfit import foretold, length_misfit, redundancy
from procedures.guards.guard import Observation
from procedures.settings import Reaction, Settings
from procedures.steps import Lengths, Phase, longest_way

NAME = "geometry"
LOOKS = frozenset({Phase.RESTING, Phase.HANDLING, Phase.RECORDING})
"""in which no winch is told to move: what moves nevertheless has no command"""
PERIOD = 0.02
"""s between two looks, each some 0.5 ms of computing: 1 mm at 0.05 m/s"""
LASTING = 0.06
"""s: three of them"""
JUMPED = 1.0
"""s for which a violation that begins with a jump must last: a body does not jump, but markers are taken for others"""
JUMP, FALLS = 2e-3, 20.0
"""m by which a marker may be off the place foreseen from the two before it; m/s² by which a body may be accelerated"""
RESTS = 3e-3
"""m by which the marker may be off the place that was compared, when what it was off there is taken"""
SAME = 1e-3
"""m of cable, likewise"""
LIKELY = 2.0
"""times the least error of a cable that would explain it: what takes more is not named"""
SURVEY = 3.2e-3
"""m, one standard deviation of a cable's length from its anchor (2 mm), attachment and marker (1 mm each) and zero
(2 mm), where the robot file states no survey"""
SPREADS = 4.0
"""standard deviations: of 24 robots surveyed like this, in 288 windows, the worst had 2.3 besides `allowed`, one of 22
others 3.3"""


Place = tuple[Lengths, Vector3]
"""lengths (m) at which the platform rested, and where the main marker was then (m)"""


def uncertainty(robot: Robot) -> float:
    """m, one standard deviation of the error of a cable's length as anchors, attachment, marker and zero give it."""
    survey = robot.survey
    if survey is None:
        return SURVEY
    parts = (
        float(np.max(survey.anchor, initial=0.0)),
        float(np.max(survey.attachment, initial=0.0)),
        survey.marker,
        survey.encoder_zero,
        survey.frame_shift,
    )
    return float(np.linalg.norm(parts))


def lacks(robot: Robot) -> str:
    """Why markers cannot stand in for the encoders of this robot, in words; empty where they can."""
    if redundancy(robot.n, len(robot.markers)) > 0:
        return ""
    markers = f"{len(robot.markers)} marker{'s' if len(robot.markers) > 1 else ''}"
    return f"with {robot.n} cables and {markers} a turn of the platform explains any place; it takes 3 markers"


class GeometryGuard:
    """The markers do not fit the lengths that the encoders tell, while every winch should stand.

    Off until markers and lengths have been compared once in this run: that they are of one frame, and
    what survey and zeros leave between them, is known from there.
    """

    name = NAME
    reaction = Reaction.QUICK_STOP

    def __init__(
        self,
        robot: Robot,
        compared: Callable[[], Place | None],
        pose_at: Callable[[Lengths], Pose],
        settings: Settings,
        newton_per_ampere: Sequence[float],
        doubt: Callable[[], str],
    ) -> None:
        """compared: where that was done last; pose_at: in which the platform rests at lengths (m).

        doubt: the end of the sentence, about what was accepted since that comparison.
        """
        self._mechanism = Mechanism(robot)
        self._misfit = length_misfit(self._mechanism)
        self._last, self._pose_at, self._settings, self._doubt = compared, pose_at, settings, doubt
        self._factors = np.array(newton_per_ampere)
        self._pulls = robot.limits.tension[0]
        self._sd = uncertainty(robot)
        self._next = 0.0
        self._compared: Place | None = None
        """the comparison that `_base` is of"""
        self._base = np.zeros(robot.n)
        """m by which the lengths were off there"""
        self._across = np.zeros((robot.n, robot.n))
        """which part of errors of lengths showed there"""
        self._pose: Pose | None = None
        self._track = _Track()
        self._since: float | None = None
        self._jumped = False
        """whether what is wrong began with a jump, or was wrong at the first look"""

    def look(self, seen: Observation) -> str | None:
        """By how much the markers contradict the lengths for too long, and which cable it would be."""
        if seen.frame is None or seen.t - seen.frame.t > self._settings.guard.sample_age:
            return None
        markers = _positions(seen.frame, len(self._mechanism.robot.markers))
        self._track.look(seen.frame.t, markers[0])
        if seen.t < self._next:
            return None
        self._next = seen.t + PERIOD
        if redundancy(self._mechanism.n, int((~np.isnan(markers).any(axis=1)).sum())) <= 0 or None in seen.winches:
            return None
        jumped, self._track.jumped = self._track.jumped, False
        lengths = np.array([sample.length for sample in seen.winches if sample is not None])
        currents = np.array([sample.current for sample in seen.winches if sample is not None])
        self._learn(lengths, markers)
        if self._compared is None or self._pose is None or not self._stand(seen):
            self._since, self._jumped = None, True  # what is wrong at the first look may have come by a jump
            return None
        off = self._off(markers, lengths, self._factors * currents >= self._pulls)
        size = float(np.linalg.norm(off))
        if size <= self._settings.guard.geometry or size <= (allowed := self._allowed(lengths)):
            self._since, self._jumped = None, False
            return None
        self._jumped |= jumped
        self._since = seen.t if self._since is None else self._since
        if seen.t - self._since < (JUMPED if self._jumped else LASTING):
            return None
        return (
            f"the markers are {1e3 * size:.1f} mm from where the cables' lengths let them be, at most "
            f"{1e3 * allowed:.1f} mm is allowed: {self._causes(off)}, so a drum may turn unseen; or markers or motion "
            f"capture's origin moved; or, if it comes back wherever the platform is displaced, the robot file's "
            f"geometry is wrong (fidim register){self._doubt()}"
        )

    def _stand(self, seen: Observation) -> bool:
        """Whether every winch has long been told to."""
        late = self._settings.guard.motion_late
        commanded = [one for one in seen.commanded if one is not None]
        return (
            seen.phase in LOOKS
            and len(commanded) == len(seen.winches)
            and all(seen.t - late > one.end for one in commanded)
        )

    def _learn(self, lengths: PerCable, markers: Positions) -> None:
        """Where lengths and markers were compared: what they were off, as soon as the platform is seen there."""
        place = self._last()
        if place is None or (self._compared is not None and place[1] is self._compared[1]):
            return
        (there, marker), here = place, tuple(float(length) for length in lengths)
        if np.linalg.norm(markers[0] - marker) > RESTS or longest_way(there, here) > SAME:
            return
        every = np.ones(self._mechanism.n, dtype=bool)
        start = self._pose or self._pose_at(there)
        self._base, self._pose = self._misfit(markers, lengths, every, start)
        self._across = foretold(self._mechanism, self._pose)
        self._compared = place

    def _off(self, markers: Positions, lengths: PerCable, pull: Mask) -> PerCable:
        """m by which cables are longer than told (pulling ones also: shorter), besides what was off where compared."""
        told, every = lengths + self._base, np.ones(self._mechanism.n, dtype=bool)
        if self._pose is None:
            return np.zeros(len(lengths))
        taut, self._pose = self._misfit(markers, told, every, self._pose)
        if pull.all():
            return taut
        some, _ = self._misfit(markers, told, pull, self._pose)
        both = np.where(pull, taut, np.maximum(taut, 0.0))
        return min(some, both, key=lambda off: float(np.linalg.norm(off)))

    def _allowed(self, lengths: PerCable) -> float:
        """m: where the platform has turned, other errors of survey and zeros show than where it was compared."""
        if self._pose is None or self._compared is None:
            return float("inf")
        shown = foretold(self._mechanism, self._pose) @ (np.eye(len(lengths)) - self._across)
        way = longest_way(self._compared[0], tuple(float(length) for length in lengths))
        survey = SPREADS * self._sd * float(np.linalg.norm(shown, 2))
        return self._settings.guard.geometry + survey + self._settings.place.part * way

    def _causes(self, off: PerCable) -> str:
        """By how much each cable alone would have to be off, the least first."""
        if self._pose is None:
            return ""
        across = foretold(self._mechanism, self._pose)
        found: list[tuple[float, int, str]] = []
        for cable, column in enumerate(across.T, start=1):
            by = float(column @ off / max(float(column @ column), 1e-6))
            if np.linalg.norm(off - by * column) <= 0.5 * np.linalg.norm(off):
                found.append((abs(by), cable, "longer" if by > 0 else "shorter"))
        found.sort()
        each = [f"cable {k} is {1e3 * by:.0f} mm {way}" for by, k, way in found if by <= LIKELY * found[0][0]]
        return (
            f"{', or '.join(each)} than its encoder says"
            if each
            else ("some cables are longer or shorter than their encoders say")
        )


class _Track:
    """The main marker's places, three in a row: a marker that moves as no body does is another one."""

    def __init__(self) -> None:
        self.jumped = False
        """since this was taken back"""
        self._seen: list[tuple[float, np.ndarray]] = []

    def look(self, t: float, place: np.ndarray) -> None:
        if np.isnan(place).any() or (self._seen and t <= self._seen[-1][0]):
            return
        self._seen = [*self._seen[-2:], (t, place)]
        if len(self._seen) < 3:
            return
        (t0, a), (t1, b), _ = self._seen
        foreseen = b + (b - a) * (t - t1) / (t1 - t0)
        allowed = JUMP + 0.5 * FALLS * (t - t1) * (t - t0)
        self.jumped |= float(np.linalg.norm(place - foreseen)) > allowed


def _positions(frame: MarkerFrame, count: int) -> Positions:
    """(count, 3) m, NaN where not seen."""
    blank = (np.nan,) * 3
    return np.array([blank if one is None else one for one in (*frame.positions, *(None,) * count)[:count]])
