"""Events of a running run: frozen values, and how they reach listeners that must not disturb it.

A listener is a quick callback; what one raises is kept for the report. Whoever is slow (a terminal, a socket) has a
bounded queue of its own.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from drivers.ports import Prompt
from fidim_lab.data.records import Role
from procedures.guards.guard import Trip
from procedures.outcomes import Outcome
from procedures.report import RunReport
from procedures.steps import Result, Step


@dataclass(frozen=True)
class RunStarted:
    """A run begins."""

    t: float
    name: str
    windows: tuple[str, ...]
    seconds: float
    """estimate for all of it"""
    between: tuple[float, float]
    """the least and the most that it takes in a run in which nothing is recorded twice, s"""


@dataclass(frozen=True)
class StepStarted:
    """A step begins."""

    t: float
    number: int
    """counts every step carried out, from 1"""
    step: Step
    left: float
    """estimated s to the end of the run"""


@dataclass(frozen=True)
class StepProgress:
    """A step goes on; at most ten a second."""

    t: float
    number: int
    step: Step
    fraction: float
    """0 to 1, as far as can be known"""
    left: float


@dataclass(frozen=True)
class Prompted:
    """A question waits for its answer."""

    t: float
    window: str
    prompt: Prompt


@dataclass(frozen=True)
class StepFinished:
    """A step has ended."""

    t: float
    number: int
    step: Step
    result: Result
    left: float


@dataclass(frozen=True)
class WindowFinished:
    """The verdict on one window, of the plan or added by the procedure: accepted, skipped or given up."""

    t: float
    window: str
    outcome: Outcome
    reason: str
    done: int
    """windows that have their verdict"""
    of: int
    role: Role = Role.IDENTIFY
    attempts: int = 0
    """recordings made, rejected ones included"""


@dataclass(frozen=True)
class Tripped:
    """A guard stopped the run."""

    t: float
    trip: Trip


@dataclass(frozen=True)
class Warned:
    """A guard saw something that does not stop the run."""

    t: float
    trip: Trip


@dataclass(frozen=True)
class Paused:
    """The robot is held until somebody resumes; sent again, with the reason, when a resumption is refused."""

    t: float
    window: str
    says: str


@dataclass(frozen=True)
class Resumed:
    """The robot was verified to be where it was held, and the run goes on."""

    t: float
    window: str
    says: str


@dataclass(frozen=True)
class RunFinished:
    """The run has ended and the robot is held."""

    t: float
    report: RunReport


Event = (
    RunStarted
    | StepStarted
    | StepProgress
    | Prompted
    | StepFinished
    | WindowFinished
    | Tripped
    | Warned
    | Paused
    | Resumed
    | RunFinished
)
Listener = Callable[[Event], None]


class Publisher:
    """Tells every listener, whatever others make of it."""

    def __init__(self, listeners: Sequence[Listener] = ()) -> None:
        self._listeners = list(listeners)
        self.failed: list[str] = []
        """what listeners raised, each once; they are told what comes next all the same: the end must reach them"""

    def __call__(self, event: Event) -> None:
        """Hand one event to every listener, in order."""
        for listener in self._listeners:
            try:
                listener(event)
            except Exception as error:  # whatever a listener does wrong must not reach the robot
                what = f"{type(error).__name__}: {error}"
                if what not in self.failed:
                    self.failed.append(what)
