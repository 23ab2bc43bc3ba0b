"""Steps for recorded windows, and the messages of a procedure: note, stop."""

from dataclasses import dataclass
from typing import ClassVar

from fidim_lab.data.records import Role
from procedures.outcomes import Outcome
from procedures.steps.base import AfterPause, Lengths, Phase, Step

SLIPPED = "slipped"
"""the answer of `CheckWindow` where the marker is beside the places that the cable lengths allow"""


@dataclass(frozen=True, kw_only=True)
class Record(Step):
    """Record markers, lengths and currents. Nothing but the recorder is touched; the motors hold."""

    phase: ClassVar[Phase] = Phase.RECORDING
    after_pause: ClassVar[AfterPause] = AfterPause.SAME_ATTEMPT

    attempt: int
    duration: float
    """s"""

    @property
    def text(self) -> str:
        """The step in words."""
        return f"record {self.duration:g} s" + (f", attempt {self.attempt}" if self.attempt > 1 else "")

    @property
    def seconds(self) -> float:
        """Estimate."""
        return self.duration


@dataclass(frozen=True)
class WindowLimits:
    """The criteria for a good window."""

    complete: float
    """least part of the samples that are there"""
    longest_gap: float
    """s without a new marker position"""
    jump: float
    """m, largest second difference of a marker's samples"""
    drift: float
    """m of slow motion of the main marker besides its swing; 0.3 of the swing's amplitude is added"""
    amplitude: float
    """m, least peak to peak of the marker's largest coordinate"""
    displacement: tuple[float, float]
    """m, largest displacement of the marker's x, y from rest that is planned for; marginal beyond"""
    displacement_tolerance: float
    """factor on `displacement` beyond which a window is rejected"""
    motors_still: float
    """m, peak to peak of an encoder length"""
    encoder_error: float
    """m, the mean of an encoder length against the planned one: motors yield to a swing to both sides alike"""
    tension: tuple[float, float]
    """N, the robot's limits (Eq. 42): marginal beyond them; rejected at 0, or at `overload`"""
    overload: float
    """N"""
    tension_over: float
    """s, moving average over the current sensor's noise"""


@dataclass(frozen=True, kw_only=True)
class CheckWindow(Step):
    """Judge the window just recorded: samples complete, tensions positive, motors still, amplitude useful.

    FAIL with the answer SLIPPED where a cable slipped, or the marker slid, since the platform rested.
    """

    after_pause: ClassVar[AfterPause] = AfterPause.NOT_INTERRUPTED

    attempt: int
    lengths: Lengths
    """m, as planned"""
    equilibrium: tuple[float, ...]
    """m, the marker at rest; empty where unknown"""
    limits: WindowLimits

    @property
    def text(self) -> str:
        """The step in words."""
        limits = self.limits
        return (
            f"check the window: {limits.complete:.0%} of the samples, no gap over {limits.longest_gap:g} s, "
            f"no jump over {limits.jump * 1e3:g} mm, "
            f"amplitude over {limits.amplitude * 1e3:g} mm, motors still within {limits.motors_still * 1e3:g} mm, "
            "tensions positive"
        )


@dataclass(frozen=True, kw_only=True)
class Accept(Step):
    """Keep the window just recorded as a part of the campaign."""

    after_pause: ClassVar[AfterPause] = AfterPause.NOT_INTERRUPTED

    attempt: int
    role: Role
    equilibrium: tuple[float, ...]
    """m"""
    outcome: Outcome
    reason: str = ""

    @property
    def text(self) -> str:
        """The step in words."""
        return f"accept as windows/{self.window}.csv"


@dataclass(frozen=True, kw_only=True)
class Reject(Step):
    """Keep the window just recorded aside, as rejected; never spliced into another."""

    after_pause: ClassVar[AfterPause] = AfterPause.NOT_INTERRUPTED

    attempt: int
    reason: str

    @property
    def text(self) -> str:
        """The step in words."""
        return f"reject attempt {self.attempt}: {self.reason}"


@dataclass(frozen=True, kw_only=True)
class GiveUp(Step):
    """Go on without a recording of this window; with the outcome PASS none was wanted."""

    after_pause: ClassVar[AfterPause] = AfterPause.NOT_INTERRUPTED

    outcome: Outcome
    reason: str

    @property
    def text(self) -> str:
        """The step in words."""
        return self.reason if self.outcome is Outcome.PASS else f"continue without {self.window}: {self.reason}"


@dataclass(frozen=True, kw_only=True)
class Note(Step):
    """A remark for the journal and whoever listens."""

    after_pause: ClassVar[AfterPause] = AfterPause.NOT_INTERRUPTED

    remark: str

    @property
    def text(self) -> str:
        """What is said."""
        return self.remark


@dataclass(frozen=True, kw_only=True)
class Stop(Step):
    """End the run here, with the robot held."""

    after_pause: ClassVar[AfterPause] = AfterPause.NOT_INTERRUPTED

    outcome: Outcome
    reason: str

    @property
    def text(self) -> str:
        """The step in words."""
        return f"stop: {self.reason}"
