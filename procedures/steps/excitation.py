"""Steps of winch-driven excitation: strokes of the winches, measuring the swing, and planning."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from procedures.steps.base import AfterPause, LastingStep, Lengths, Phase, Step

if TYPE_CHECKING:  # scipy: a second that a run without excitation need not wait
    from fidim_lab.identification.excitation.seen import SwingOscillations
    from fidim_lab.model.swing import Swing


@dataclass(frozen=True)
class StrokeChain:
    """Moves of all winches along one line in length space, one after another."""

    begin: float
    """s since the first stroke of the step"""
    starts: tuple[float, ...]
    """s since `begin`, of each stroke"""
    targets: tuple[Lengths, ...]
    """m, where each goes"""
    speeds: Lengths
    """m/s, of each winch; 0 for one that does not move"""
    accelerations: Lengths
    """m/s²"""
    seconds: float
    """until the last one has ended"""


@dataclass(frozen=True, kw_only=True)
class Strokes(Step):
    """Short moves of the winches about an equilibrium, and back to it: they set the platform swinging, or calm it.

    Values: the time at which the winches hold again, s. FAIL where they could not begin in time.
    """

    phase: ClassVar[Phase] = Phase.MOVING
    after_pause: ClassVar[AfterPause] = AfterPause.SAME_ATTEMPT

    lengths: Lengths
    """of the equilibrium, m"""
    chains: tuple[StrokeChain, ...]
    why: str
    displacement: tuple[float, ...] = ()
    """m: as after which the platform is to swing, x and y of the marker; empty where it is calmed"""
    begin: float | None = None
    """monotonic s of the first stroke; None as soon as may be"""
    tolerance: float
    """m of encoder error at which a winch is where it should be"""

    @property
    def text(self) -> str:
        """The step in words."""
        strokes = sum(len(chain.targets) for chain in self.chains)
        most = 1e3 * max(
            abs(a - b) for chain in self.chains for t in chain.targets for a, b in zip(t, self.lengths, strict=True)
        )
        return f"{self.why}: {strokes} strokes of the winches, at most {most:.1f} mm off, {self.seconds:.1f} s"

    @property
    def details(self) -> Mapping[str, Any]:
        """The cable lengths at its end."""
        return {"lengths": [round(length, 6) for length in self.lengths]}

    @property
    def place(self) -> tuple[object, ...]:
        """Also what for."""
        return (type(self), self.window, self.why)

    @property
    def seconds(self) -> float:
        """From the first stroke to the hold."""
        return max(chain.begin + chain.seconds for chain in self.chains)


@dataclass(frozen=True, kw_only=True)
class WatchSwing(LastingStep):
    """Look at how the platform swings. Values: `swing_values`; FAIL where the marker was seen too seldom."""

    swing: "Swing"

    @property
    def text(self) -> str:
        """The step in words."""
        return f"measure for {self.over:g} s how the platform swings"


@dataclass(frozen=True, kw_only=True)
class SeeRecordedSwing(Step):
    """How the platform swung when the window just recorded began. Values and FAIL as `WatchSwing`."""

    after_pause: ClassVar[AfterPause] = AfterPause.NOT_INTERRUPTED
    says: ClassVar[str] = "measure the swing of each mode"

    attempt: int
    swing: "Swing"
    rest: tuple[float, ...]
    """m, the marker"""


@dataclass(frozen=True, kw_only=True)
class IdentifyBody(Step):
    """Identify the body from the windows so far, in a process of its own, to plan with.

    Values: nine parameters and the ways in which they may be off (9 × 9, row by row, a column each), m and m²; none
    where nothing can be told.
    """

    after_pause: ClassVar[AfterPause] = AfterPause.NOT_INTERRUPTED
    says: ClassVar[str] = "identify from the windows so far, to plan the next ones"
    takes: ClassVar[float] = 6.0


@dataclass(frozen=True, kw_only=True)
class Think(Step):
    """Compute beside the run, so that guards and bus go on meanwhile; the job keeps its answer itself.

    Some stand between a recording and its verdict, where an interruption would lose the window.
    """

    after_pause: ClassVar[AfterPause] = AfterPause.NOT_INTERRUPTED
    takes: ClassVar[float] = 0.5

    what: str
    job: Callable[[], None]

    @property
    def text(self) -> str:
        """The step in words."""
        return self.what


def swing_values(seen: "SwingOscillations", swing: "Swing") -> tuple[float, ...]:
    """A swing as a step's values: time, then of each mode state, frequency (Hz), damping, amplitude (m)."""
    states = seen.states(swing, seen.t)
    columns = [np.real(states), np.imag(states), seen.frequencies, seen.damping, seen.amplitudes]
    return (seen.t, *(float(value) for column in columns for value in column))


@dataclass(frozen=True, eq=False)
class SeenSwing:
    """The swing from `swing_values`."""

    t: float
    """monotonic s, or s of a window"""
    states: np.ndarray
    frequencies: np.ndarray
    damping: np.ndarray
    amplitudes: np.ndarray

    @staticmethod
    def of(values: tuple[float, ...]) -> "SeenSwing":
        """From a step's values."""
        table = np.array(values[1:]).reshape(5, -1)
        return SeenSwing(values[0], table[0] + 1j * table[1], *table[2:])
