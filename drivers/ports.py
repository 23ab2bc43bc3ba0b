"""All hardware interfaces that a procedure may use: clock, winches, markers, and the operator.

Real and simulated devices differ below these ports only; a procedure cannot tell which it drives.
Records are immutable and carry the monotonic time at which they were true; an old value is unknown.
"""

from collections.abc import AsyncIterator, Awaitable, Callable
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Protocol, TypeVar

from drivers.trajectory import Trajectory

T = TypeVar("T")


class Clock(Protocol):
    """Time as a port. `now` is monotonic, in seconds; a simulation's clock jumps instead of waiting."""

    def now(self) -> float:
        """Monotonic seconds."""
        ...

    async def sleep(self, seconds: float) -> None:
        """Let at least `seconds` pass (0 lets other tasks run)."""
        ...


class Disk(Protocol):
    """The disk as a port: whoever holds a robot never waits for it, however long it takes.

    Jobs are functions that read or write files, and nothing else. They are carried out in the order in which they were
    given, but a `secure` never keeps a later `put` waiting: what is written survives the process at once.
    """

    @property
    def error(self) -> str | None:
        """Why something that was put or secured is not on the disk, or that the disk does not keep up; for a guard."""
        ...

    def put(self, job: Callable[[], object], size: int = 0) -> None:
        """Have it carried out; never waits, never raises: its HardwareError is `error`. size: bytes that wait."""
        ...

    def secure(self, job: Callable[[], object]) -> None:
        """As `put`, for what takes long: bringing to the disk (fsync) what was put before."""
        ...

    async def do(self, job: Callable[[], T], longest: float | None = None) -> T:
        """Wait until all that was given before is done, and this; returns what it returns, raises what it raises.

        Raises HardwareError as well after `longest` s (a default of its own), and where the disk takes nothing more.
        """
        ...


class DriveState(StrEnum):
    """States of the CiA 402 drive machine, plus what we say when we do not know."""

    NOT_READY = "not ready to switch on"
    SWITCH_ON_DISABLED = "switch on disabled"
    READY = "ready to switch on"
    SWITCHED_ON = "switched on"
    OPERATION_ENABLED = "operation enabled"
    QUICK_STOP_ACTIVE = "quick stop active"
    FAULT_REACTION = "fault reaction active"
    FAULT = "fault"
    UNKNOWN = "unknown"
    """no status word, or one too old to be believed"""


@dataclass(frozen=True)
class WinchSample:
    """A winch's sample of one bus cycle."""

    t: float
    """monotonic s of the SYNC that sampled it"""
    state: DriveState
    length: float
    """cable length from the encoder, m"""
    velocity: float
    """m/s, positive pays cable out"""
    current: float
    """A; positive pulls"""
    target_reached: bool
    fault: str = ""
    """in words, empty without one"""
    following_error: float | None = None
    """m of cable by which the motor is off the place that its drive wants; None where it does not tell"""
    temperature: float | None = None
    """of the drive, °C; None where it does not tell"""
    heartbeat_age: float | None = None
    """s since the drive's heartbeat when this was asked for; None before the first, or without heartbeats"""
    emergencies: int = 0
    """emergency messages of the drive so far"""
    lost: int = 0
    """bus cycles so far that brought no whole sample"""
    moved: int = 0
    """which way the winch went last: +1 paid out, −1 wound, 0 where that is not known"""
    blind: bool = False
    """the drive has contradicted its own encoder: that proves no standstill"""


class Winch(Protocol):
    """One winch with its cable. Every command raises DeviceError where the drive refuses or does not answer."""

    @property
    def name(self) -> str:
        """As in the rig file, for messages."""
        ...

    async def configure(self) -> None:
        """Check identity, write limits and stop reactions, read them back; the drive stays without power."""
        ...

    async def set_length(self, length: float) -> None:
        """The cable is `length` (m) long where the encoder stands now; the drive is configured anew before power."""
        ...

    async def enable(self) -> None:
        """Power on and hold position. A fault is never reset here."""
        ...

    async def prepare(self, speed: float, acceleration: float) -> None:
        """Set speed (m/s) and acceleration (m/s²) of the next move, verified; nothing moves.

        Done for all winches first, the moves then begin together, or none begins.
        """
        ...

    async def move_to(self, length: float, speed: float, acceleration: float) -> None:
        """Start a move to a cable length (m), at most at `speed` (m/s); returns once the drive has the set-point."""
        ...

    async def hold(self) -> None:
        """Stop on the ramp and hold position with power on."""
        ...

    def quick_stop(self, *, again: bool = False) -> None:
        """Stop on the quick-stop ramp: a single write, never waits. again: repeated, the ramp stays the first one's."""
        ...

    def force_stop(self) -> None:
        """Stop by the network's own means, where a quick stop is not obeyed: a single write, never waits.

        The drive says nothing in bus cycles from then on.
        """
        ...

    def fall_silent(self) -> float:
        """Give no sign of life to any drive of this winch's bus, for good: their own watchdogs then stop them.

        Returns the s after which that must have happened. Samples end with it; `ask_length` goes on.
        """
        ...

    async def ask_length(self) -> float:
        """The cable length (m) from the encoder, asked for outside the bus cycle. Raises DeviceError."""
        ...

    def power_off(self) -> None:
        """Take the power away: a single write, never waits."""
        ...

    def latest(self) -> WinchSample | None:
        """The newest sample, None before the first; look at its time before believing it."""
        ...

    @property
    def commanded(self) -> Trajectory | None:
        """The commanded cable length (m); None while the winch has not been given power."""
        ...

    @property
    def powered(self) -> bool:
        """Whether it was given power here, and that was not taken since, whatever it says of itself."""
        ...


class Trial(StrEnum):
    """What a trial withholds or commands, at low speed and without load."""

    QUICK_STOP = "quick stop"
    HALT = "halt"
    LOST_HEARTBEAT = "heartbeat withheld"
    LOST_SYNC = "SYNC withheld"
    POSITION_LIMIT = "position limit"
    FOLLOWING_ERROR = "following error"


@dataclass(frozen=True)
class TrialStop:
    """How a winch should stop in a trial, by its drive's settings."""

    reaction: float
    """s until it begins to"""
    deceleration: float
    """m/s²"""


class TrialBench(Protocol):
    """What one winch must do besides, so that its stops are proven: without load, one winch after another.

    Every command raises DeviceError where the drive refuses or does not answer.
    """

    @property
    def brake_time(self) -> float:
        """s that the brake takes."""
        ...

    def lacks(self, trial: Trial) -> str:
        """Why this trial cannot be made on this drive, in words; empty where it can."""
        ...

    def stop(self, trial: Trial, speed: float, acceleration: float) -> TrialStop:
        """The expected result of a trial at this speed (m/s), on a move with this ramp (m/s²)."""
        ...

    def room(self, length: float, way: float) -> bool:
        """Whether the cable (m) may go so far (m, with its sign)."""
        ...

    async def arm(self, trial: Trial, length: float) -> None:
        """What must be done before the move: the position limit comes to this cable length (m)."""
        ...

    async def start(self, length: float, speed: float, acceleration: float) -> None:
        """Begin to move to a length (m); until `leave`, what the winch does is the trial's matter, and no guard's."""
        ...

    async def provoke(self, trial: Trial) -> None:
        """Withhold or command it, once, in motion."""
        ...

    def end(self) -> None:
        """Withhold nothing any more: a single act, never waits."""
        ...

    def leave(self) -> None:
        """As `end`; and what the winch does is a guard's matter again. Command it to stop, or take its power."""
        ...

    async def recover(self) -> None:
        """Acknowledge, in the name of the person who is there, the fault that the trial has caused; no power."""
        ...

    async def identity(self) -> tuple[int, ...]:
        """Vendor, product code, revision and serial number of the drive (1018:1 to 4); 0 where it tells none."""
        ...


PullTaut = Callable[[float, float, float], Awaitable[float]]
"""Winds an enabled winch with a current (A) at a speed (m/s), over a way (m) at most, until its cable is taut.

Returns the way that it took. Raises RefusedError where its drive cannot, DeviceError where the cable does not become
taut or pays out, or the drum runs away: it then stands."""


@dataclass(frozen=True)
class MarkerFrame:
    """One frame of motion capture."""

    t: float
    """monotonic s of arrival"""
    number: int
    """the device's own frame counter"""
    positions: tuple[tuple[float, float, float] | None, ...]
    """m, motion-capture frame, main marker first; None where occluded"""

    @property
    def main(self) -> tuple[float, float, float] | None:
        """The main marker's, None where it was not seen."""
        return self.positions[0] if self.positions else None


class MarkerSource(Protocol):
    """A stream of marker frames."""

    @property
    def rate(self) -> float:
        """Frames a second, as configured, Hz."""
        ...

    def latest(self) -> MarkerFrame | None:
        """The newest frame, None before the first."""
        ...

    def frames(self) -> AsyncIterator[MarkerFrame]:
        """Every frame from now on, in order of frame number; late, doubled and torn ones are counted and left out."""
        ...

    def counters(self) -> dict[str, int]:
        """How many frames were received, lost, late, doubled, malformed so far."""
        ...


class ReleaseState(StrEnum):
    """The state of a release device."""

    HOLDS = "holds"
    RELEASED = "released"
    UNKNOWN = "unknown"
    """it has not said so lately"""


class Release(Protocol):
    """A device that holds the displaced platform and lets it go on command. Commands raise DeviceError."""

    @property
    def name(self) -> str:
        """For messages."""
        ...

    @property
    def state(self) -> ReleaseState:
        """Its last reported state; UNKNOWN where that is too old."""
        ...

    @property
    def fault(self) -> str:
        """The fault while it held, in words; latched, empty without one."""
        ...

    async def hold(self) -> None:
        """Take hold; returns once the device has confirmed it."""
        ...

    async def release(self) -> None:
        """Let go; returns once the device has confirmed it."""
        ...


@dataclass(frozen=True)
class GaugeReading:
    """One line of a measuring device."""

    t: float
    """monotonic s of arrival"""
    values: tuple[float, ...]
    """SI, one for each of the gauge's columns"""


class Gauge(Protocol):
    """A measuring device beside winches and motion capture: load cells, an inclinometer."""

    @property
    def name(self) -> str:
        """For messages."""
        ...

    @property
    def columns(self) -> tuple[str, ...]:
        """Of a recorded window: f1 … fn (N, tension of that cable by load cell), tilt_x, tilt_y (rad)."""
        ...

    @property
    def age(self) -> float:
        """s after which a reading is unknown."""
        ...

    @property
    def uncertainty(self) -> float:
        """Standard deviation of one reading's error, SI."""
        ...

    def latest(self) -> GaugeReading | None:
        """The newest reading, None before the first; look at its time before believing it."""
        ...


class Bus(Protocol):
    """The bus of the winches, as somebody who listens to it knows it."""

    @property
    def strangers(self) -> str:
        """Another master, or another node of a drive's id, in words; latched, empty without one."""
        ...

    @property
    def remark(self) -> str:
        """Faults so far that did not stop the run, with their remedy, in words; empty without any."""
        ...


class PromptKind(StrEnum):
    """A question to the person at the robot."""

    DISPLACE_AND_RELEASE = "displace-and-release"
    HANG_IN = "hang-in"
    """displace, and let the release device take hold"""
    STEADY = "steady"
    CONFIRM = "confirm"


@dataclass(frozen=True)
class Prompt:
    """A question that a person, a script or a simulated hand answers."""

    kind: PromptKind
    text: str
    choices: tuple[str, ...] = ("done", "skip", "abort")
    displacement: tuple[float, ...] = field(default=())
    """wanted displacement of the main marker's x, y from rest, m (DISPLACE_AND_RELEASE, HANG_IN)"""


class Operator(Protocol):
    """Whoever answers prompts: a person at a console or UI, a script, a simulated hand."""

    async def answer(self, prompt: Prompt) -> str:
        """One of the prompt's choices, once what was asked has been done."""
        ...


@dataclass(frozen=True)
class Rig:
    """The hardware of one experiment, real or simulated."""

    clock: Clock
    winches: tuple[Winch, ...]
    markers: MarkerSource
    operator: Operator
    release: Release | None = None
    gauges: tuple[Gauge, ...] = ()
    bus: Bus | None = None
    """None: the winches share none"""
    trials: tuple[TrialBench, ...] = ()
    """one for each winch, where their stops can be tried"""
    pulls: tuple[PullTaut, ...] = ()
    """one for each winch, where slack can be taken up by torque"""
