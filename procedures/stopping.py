"""One winch that must stop: what its encoder shows, and whether it obeys.

It obeys as long as it is where its ramp has it (`motion_guard.Follower`), and it stands once its encoder has not moved
for a while. A winch that has had power and is not seen any more counts as one that does not obey, and so does one that
is still enabled after a quick stop: it may stand, but has not heard.
"""

import contextlib
from dataclasses import asdict, dataclass

from drivers.ports import DriveState, Winch, WinchSample
from drivers.trajectory import Trajectory
from procedures.guards.motion_guard import Follower, Tolerance
from procedures.settings import GuardSettings, HoldSettings

POWERED = (DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE)
"""states in which a drive keeps the cable by its motor"""
AGAIN = 0.02
"""s between two quick stops to a drive that does not confirm it: two cycles at 100 Hz, in which a confirmation comes"""
_ROUNDING = 1e-6
"""s, of times that are differences"""
_UNHEARD = (DriveState.OPERATION_ENABLED, DriveState.UNKNOWN)
"""states in which a drive may not have heard a quick stop"""
_NOT_TAKEN = "is still in operation enabled after a quick stop"


@dataclass(frozen=True)
class StoppedWinch:
    """How one winch came to a stop, by its own encoder."""

    name: str
    stands: bool
    """whether it was seen to stand still"""
    obeyed: bool
    """False where it went on, or was not seen any more, so that stronger means were needed"""
    moved: float | None
    """m of cable since the stop was commanded, as seen last; None: nothing was seen"""
    seconds: float
    """from the command until it was last seen to move"""
    place: float | None
    """m of cable, as seen last"""
    says: str = ""
    """what is wrong with it, in words; empty where nothing is"""

    @property
    def values(self) -> dict[str, str | bool | float | None]:
        """For journal and summary: m and s."""
        told = asdict(self)
        return {key: round(value, 6) if isinstance(value, float) else value for key, value in told.items()}


def quick_stop(winch: Winch, *, again: bool = False) -> None:
    """A single write; a winch that cannot even be written to must not keep the others from being stopped."""
    with contextlib.suppress(Exception):
        winch.quick_stop(again=again)


class Stopping:
    """One winch from the command to stop until it stands. Make it before the command is given."""

    def __init__(
        self, winch: Winch, now: float, settings: HoldSettings, guard: GuardSettings, *, quick_stopped: bool
    ) -> None:
        self.winch = winch
        self._quick_stopped = quick_stopped
        self.forced = False
        """stopped by NMT: it says nothing any more"""
        self.stands = False
        self._settings = settings
        self._age = guard.sample_age
        self._tolerance = Tolerance.of(guard)
        self._follower = Follower(self._tolerance)
        self._began = self._since = self._told = now
        sample = winch.latest()
        self._start = self._place = None if sample is None else sample.length
        self._anchor = self._place
        """where it was seen to move last, at `_since`"""
        self._wrong = self._moves = ""
        self._jumped = 0.0
        """m by which its encoder was elsewhere at once"""
        self._unseen = False
        self._seen = False
        """whether a sample has come since the command"""
        self._sent = now
        """when a quick stop was written last"""
        self._repeated = False

    def look(self, now: float, *, final: bool) -> bool:
        """Take the newest sample; whether the winch does not obey. final: it must stand by now."""
        if self.forced:
            return False
        sample = self.winch.latest()
        if self._quick_stopped:
            self._repeat(now, DriveState.UNKNOWN if sample is None else sample.state)
        powered = sample is not None and sample.state in POWERED  # by somebody else, where we have commanded nothing
        had_power = self.winch.powered or powered  # the others have nothing to obey with
        if sample is None or now - sample.t > self._age:
            self.stands, self._unseen = False, True
            self._moves = "has never reported" if sample is None else f"has not answered for {now - sample.t:.2f} s"
            self._wrong = self._moves if final or self._should_stand(now) else ""
            return bool(self._wrong) and had_power
        self._place, self._unseen = sample.length, False
        self._seen |= sample.t > self._began
        if self._anchor is None or abs(sample.length - self._anchor) > self._settings.still:
            self._anchor, self._since = sample.length, sample.t
        deaf = self._quick_stopped and sample.state is DriveState.OPERATION_ENABLED
        self.stands = sample.t - self._since >= self._settings.still_for and not deaf
        self._moves = _NOT_TAKEN if deaf else "" if self.stands else "still moves"
        self._wrong = self._follower.look(sample, self.winch.commanded)
        self._jumped = self._jumped or self._jump(sample, self.winch.commanded)
        if deaf and sample.t > self._told and self._should_stand(sample.t):
            self._wrong = self._wrong or _NOT_TAKEN
        if final:
            self._wrong = self._wrong or self._moves
        return bool(self._wrong) and had_power

    def _jump(self, sample: WinchSample, commanded: Trajectory | None) -> float:
        """How far the first sample of a stop is off, beyond what a drive may be late; 0 for one that is not.

        A stop is compared from that sample on, for after a hang of this computer the drive may be anywhere: then it is
        no jump.
        """
        if commanded is None or sample.t - commanded.t > self._age:
            return 0.0
        off, allowed = self._follower.behind, self._tolerance
        return off if abs(off) > allowed.place + allowed.late * abs(commanded.velocity) else 0.0

    def _repeat(self, now: float, state: DriveState) -> None:
        """A frame may be lost: the quick stop is written again until the drive's statusword confirms it.

        Its ramp then begins with the one that was heard.
        """
        if state in _UNHEARD:
            if now - self._sent >= AGAIN - _ROUNDING:
                quick_stop(self.winch, again=True)
                self._sent, self._repeated = now, True
        elif self._repeated:
            quick_stop(self.winch)
            self._told, self._follower, self._repeated = now, Follower(self._tolerance), False

    def quick_stop(self, now: float) -> None:
        """A quick stop where a hold was refused, or not answered: from now on the drive must show that it heard it."""
        quick_stop(self.winch)
        if not self._quick_stopped:
            self._quick_stopped, self._told, self._follower = True, now, Follower(self._tolerance)

    def waited_for(self, now: float) -> bool:
        """Whether a quick stop was given so lately that it cannot have shown yet."""
        return self._quick_stopped and now <= self._told + self._tolerance.late + self._settings.still_for

    def escalate(self, now: float, *, final: bool) -> None:
        """What was commanded last is not obeyed: a quick stop, and NMT stop after that; both where there is no time."""
        self._told, self._follower = now, Follower(self._tolerance)
        if not self._quick_stopped:
            self._quick_stopped = True
            quick_stop(self.winch)
            if not final:
                return
        self.forced, self.stands = True, False
        with contextlib.suppress(Exception):
            self.winch.force_stop()

    def _should_stand(self, now: float) -> bool:
        """Whether its ramp should have ended."""
        commanded = self.winch.commanded
        return now > max(self._told if commanded is None else commanded.end, self._told) + self._tolerance.late

    def asked(self, now: float, first: float | None, last: float | None) -> None:
        """The encoder's answers at two times, after the watchdogs of all drives have acted."""
        if last is None or first is None:
            self._moves = "it has not answered since"
            self.stands = self.stands and not self.forced
            return
        self._place, self._seen = last, True
        self.stands = abs(last - first) <= self._settings.still
        self._moves = "it stands still now" if self.stands else "it still moves"
        if not self.stands:
            self._since = now

    def told(self) -> StoppedWinch:
        """The result in words."""
        moved = None
        if self._seen and self._place is not None and self._start is not None:
            moved = self._place - self._start
        seconds = max(self._since - self._began, 0.0)
        says = "" if self.stands else f"{self.winch.name} {self._moves.removeprefix('it ')}"
        if self._jumped:
            says = says or f"{self.winch.name} stands still"
            says += (
                f"; its encoder jumped by {self._jumped * 1e3:+.1f} mm as it was stopped, so its length is not known "
                "any more: home it before the next run"
            )
        if self.forced:
            how = "was not seen to stop" if self._unseen else "did not obey the stop"
            went = "" if moved is None else f", {abs(moved) * 1e3:.1f} mm by its encoder from where it was then"
            says = (
                f"{self.winch.name} {how} ({self._wrong}{went}): NMT stop was sent, then heartbeat and SYNC were "
                f"withheld; {self._moves}"
            )
        return StoppedWinch(self.winch.name, bool(self.stands), not self.forced, moved, seconds, self._place, says)
