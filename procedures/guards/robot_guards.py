"""Guards of the robot: drives, cables, markers, motors. `standard_guards` is the set of every run."""

import math
from collections.abc import Callable, Mapping, Sequence

from drivers.ports import DriveState, MarkerFrame, WinchSample
from procedures.guards.drive_guards import BusGuard, FollowingErrorGuard, TemperatureGuard
from procedures.guards.guard import Always, Guard, Observation, Reacting
from procedures.guards.motion_guard import MotionGuard, Tolerance
from procedures.settings import GuardSettings, Reaction
from procedures.steps import Phase

PUSHES = (
    "; a cable cannot push: is the sign of its drive wrong (direction, 607E), were two drives exchanged, or is "
    "its current measured wrongly?"
)
UNDER, SLACK = "under", "slack"
"""the lower threshold, and the same while somebody handles the platform"""
SLACKENED = 0.5
"""of the robot's lowest allowed tension: what is under it so long is slack. The mean of a slack cable is 0 and its
ammeter's noise 2 N in simulation, where a hand that displaces the platform leaves 19 N and more of 20"""
CARRIED = (
    " while the platform is handled; let it down slowly until all cables pull: a slack one may be longer than it seems"
)
MOVES = 0.02
"""m/s of cable at which a motor certainly works"""


class DriveGuard:
    """A drive reports a fault or has left OPERATION ENABLED."""

    name = "drive"
    reaction = Reaction.QUICK_STOP

    def __init__(self, winches: Sequence[str]) -> None:
        self._winches = winches

    def look(self, seen: Observation) -> str | None:
        """The first drive that is not enabled, with all others in which the same is wrong (a bus that failed)."""
        faults: dict[str, str] = {}
        states: dict[str, str] = {}
        for winch, sample in zip(self._winches, seen.winches, strict=True):
            if sample is None or sample.state is DriveState.UNKNOWN:
                continue  # the staleness guard's matter
            if sample.fault:
                faults[winch] = sample.fault
            elif sample.state is not DriveState.OPERATION_ENABLED:
                states[winch] = f"“{sample.state}”, “{DriveState.OPERATION_ENABLED}” is expected"
        count = len(self._winches)
        return _shared(faults, count, "reports a fault:", "report a fault:") or _shared(
            states, count, "is in state", "are in state"
        )


ALLOWED = {Phase.WITHOUT_POWER: 0, Phase.TRYING: 1}
"""winches that may have power"""


class PowerGuard:
    """A winch has power while no winch may, or another than the one that is tried: somebody else gives it.

    A person may be at the robot, and nothing is compared with an encoder that nobody here has commanded.
    """

    name = "power"
    reaction = Reaction.QUICK_STOP

    def __init__(self, winches: Sequence[str]) -> None:
        self._winches = winches

    def look(self, seen: Observation) -> str | None:
        """Those that are enabled, where they are too many."""
        samples = zip(self._winches, seen.winches, strict=True)
        enabled = [winch for winch, sample in samples if sample and sample.state is DriveState.OPERATION_ENABLED]
        if len(enabled) <= ALLOWED.get(seen.phase, len(enabled)):
            return None
        names, have = " and ".join(enabled), "has" if len(enabled) == 1 else "have"
        alone = " at the same time, but only one is tested" if seen.phase is Phase.TRYING else ""
        return f"{names} {have} power{alone}; another program or a vendor's tool has switched it on"


class StaleGuard:
    """A winch has stopped reporting."""

    name = "stale winch"
    reaction = Reaction.QUICK_STOP

    def __init__(self, winches: Sequence[str], age: float) -> None:
        self._winches = winches
        self._age = age

    def look(self, seen: Observation) -> str | None:
        """The winches whose newest sample is too old; where it is all of them, what they have in common."""
        silent: dict[str, str] = {}
        for winch, sample in zip(self._winches, seen.winches, strict=True):
            age = 0.0 if sample is None else max(seen.t - sample.t, 0.0)
            if sample is None:
                silent[winch] = "at all so far"
            elif age > self._age:
                silent[winch] = f"for {age:.2f} s; at most {self._age:g} s is allowed"
            elif sample.state is DriveState.UNKNOWN:
                silent[winch] = f"for {age:.2f} s, so its values are too old"
        says = _shared(silent, len(self._winches), "has not answered", "have not answered")
        if says is not None and 1 < len(silent) == len(self._winches):
            says += "; look at the bus, its adapter and power, and whether this computer's control loop kept up"
        return says


class TensionGuard:
    """A cable's tension, from its motor current, stays beyond a threshold, or is not measured any more.

    A violation begins beyond the threshold, ends only `hysteresis` on its good side, and trips after `lasting`.
    A hand at the platform may slacken a cable, but not for long: markers cannot tell how long a slack cable is, so that
    its drum may pay out unseen, and as far as it has the platform falls when it is let go.
    """

    name = "tension"
    reaction = Reaction.QUICK_STOP

    def __init__(
        self, newton_per_ampere: Sequence[float], tension: tuple[float, float], settings: GuardSettings
    ) -> None:
        """tension: the robot's limits, N."""
        self._factors = newton_per_ampere
        self._low, self._high = settings.slack * tension[0], settings.overload * tension[1]
        self._hysteresis = settings.hysteresis
        self._lasting = settings.tension_for
        self._handled = max(self._low, SLACKENED * tension[0]), settings.slack_handled
        self._since: dict[tuple[int, str], float] = {}
        self._stuck_for = settings.current_stuck
        self._unchanged: dict[int, tuple[float, float]] = {}
        """cable → current, and since when it is exactly that while the winch moves"""

    def look(self, seen: Observation) -> str | None:
        """The first cable whose tension has been beyond a threshold for too long."""
        for cable, (sample, factor) in enumerate(zip(seen.winches, self._factors, strict=True), start=1):
            if sample is None:
                continue
            tension = factor * sample.current
            if math.isnan(tension):
                return f"the tension of cable {cable} is unknown: its drive reports neither current nor torque"
            handled = seen.phase is Phase.HANDLING
            under, low, lasting = (SLACK, *self._handled) if handled else (UNDER, self._low, self._lasting)
            self._since.pop((cable, UNDER if handled else SLACK), None)
            if self._lasts(seen.t, (cable, under), tension - low, lasting):
                says = f"cable {cable} has {tension:.1f} N, under {low:g} N for {lasting:g} s"
                return says + (CARRIED if handled else PUSHES * (tension < 0.0))
            if self._lasts(seen.t, (cable, "over"), self._high - tension, self._lasting):
                return f"cable {cable} has {tension:.1f} N, over {self._high:g} N for {self._lasting:g} s"
            if self._is_stuck(seen.t, cable, sample):
                return (
                    f"the motor current of cable {cable} is exactly {sample.current:g} A for {self._stuck_for:g} s "
                    "while its winch moves: the sensor is stuck, so the tension is unknown"
                )
        return None

    def _is_stuck(self, t: float, cable: int, sample: WinchSample) -> bool:
        """A motor that works never needs exactly the same current, digit for digit, for long."""
        before, since = self._unchanged.get(cable, (sample.current, t))
        if sample.current != before or abs(sample.velocity) < MOVES:
            since = t
        self._unchanged[cable] = (sample.current, since)
        return t - since >= self._stuck_for

    def _lasts(self, t: float, which: tuple[int, str], room: float, lasting: float) -> bool:
        """Whether the room to the threshold (N, negative beyond it) has been used up for too long."""
        if room < 0.0:
            self._since.setdefault(which, t)
        elif room > self._hysteresis:
            self._since.pop(which, None)
        return which in self._since and t - self._since[which] >= lasting


REPEATED, KEPT = 10, 3000
"""frames in a row that are exactly those of an earlier stretch, in its order; how many are remembered (30 s at 100 Hz).
Swings of a minute, in digits of 1 mm to 0.01 mm and with noise of 0 to 0.3 mm, repeated at most 5 in their order"""


class _Repetition:
    """Whether a stream sends old places of the main marker under new numbers: from then on all that it says is late."""

    def __init__(self) -> None:
        self._first: dict[tuple[float, float, float], int] = {}
        self._number: int | None = None
        self._lag = self._count = 0

    def look(self, frame: MarkerFrame | None) -> str:
        """What is wrong in words; empty where nothing is."""
        if frame is None or frame.main is None or frame.number == self._number:
            return ""
        self._number = frame.number
        lag = frame.number - self._first.setdefault(frame.main, frame.number)
        self._lag, self._count = lag, self._count + 1 if lag == self._lag else 1
        if len(self._first) > KEPT:
            del self._first[next(iter(self._first))]
        if lag <= 0 or self._count < REPEATED:
            return ""
        return (
            f"motion capture sends the places of {lag} frames before once more, under new numbers: all it says is late"
        )


class MarkerGuard:
    """The main marker gives no new position: the stream is silent, the marker is occluded, or its value is frozen.

    Not counted while somebody handles the platform and may stand before a camera. A stream that begins to send old
    places as new ones counts at any time but while a window is recorded, whose check rejects it.
    """

    name = "marker"
    reaction = Reaction.HOLD

    def __init__(self, lasting: float) -> None:
        self._lasting = lasting
        self._position: tuple[float, float, float] | None = None
        self._number: int | None = None
        self._new_at: float | None = None
        self._why = ""
        self._repetition = _Repetition()

    def look(self, seen: Observation) -> str | None:
        """Whether the last new position is too long ago, or old ones come again."""
        if (says := self._repetition.look(seen.frame)) and seen.phase is not Phase.RECORDING:
            return says
        if self._new_at is None or seen.phase is Phase.HANDLING or self._is_new(seen.frame):
            self._new_at = seen.t
        lost = seen.t - self._new_at
        return f"{self._why} for {lost:.2f} s; at most {self._lasting:g} s is allowed" if lost > self._lasting else None

    def _is_new(self, frame: MarkerFrame | None) -> bool:
        if frame is None or frame.number == self._number:
            self._why = "no frame has come from motion capture"
            return False
        self._number = frame.number
        before, self._position = self._position, frame.main
        self._why = "the main marker is lost" if frame.main is None else "the main marker is frozen"
        return frame.main not in (None, before)


def _shared(wrong: Mapping[str, str], count: int, one: str, many: str) -> str | None:
    """What is wrong with the first winch, said of all (of `count`) with which the same is wrong."""
    if not wrong:
        return None
    what = next(iter(wrong.values()))
    names = [winch for winch, other in wrong.items() if other == what]
    if len(names) == 1:
        return f"{names[0]} {one} {what}"
    return f"{f'all {count} winches' if len(names) == count else ', '.join(names)} {many} {what}"


class LogGuard:
    """Something of the run cannot be written any more: what happens from now on would be missing."""

    name = "log"
    reaction = Reaction.HOLD

    def __init__(self, error: Callable[[], str | None]) -> None:
        """`error`: why writing ended, None while it goes on."""
        self._error = error

    def look(self, seen: Observation) -> str | None:
        """Why the log has ended."""
        return self._error()


def standard_guards(
    winches: Sequence[str], newton_per_ampere: Sequence[float], tension: tuple[float, float], settings: GuardSettings
) -> tuple[Guard, ...]:
    """A fresh set for one run, reacting as the settings say; `tension` are the robot's limits, N.

    One whose reaction is to reject the window spoils the recording that goes on, which its check then rejects.
    """
    guards = (
        StaleGuard(winches, settings.sample_age),
        DriveGuard(winches),
        TensionGuard(newton_per_ampere, tension, settings),
        MarkerGuard(settings.marker_for),
        MotionGuard(winches, Tolerance(settings.slip), "slip", Phase.RECORDING),
        FollowingErrorGuard(winches, settings),
        TemperatureGuard(winches, settings),
        BusGuard(winches, settings.bus_lost),
    )
    always = (MotionGuard(winches, Tolerance.of(settings)), PowerGuard(winches))
    return (
        *(Always.by(settings, guard) for guard in always),
        *(Reacting.by(settings, guard) for guard in guards),
    )
