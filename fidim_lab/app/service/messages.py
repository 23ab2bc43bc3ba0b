"""What is said on the service's socket, "fidim-service/1": one JSON object a line, UTF-8, each ended by a newline.

Every message is one of these models (a client's are in `commands`); an unknown key or type is an error. Numbers are SI.
docs/messages.md is made from both files.
"""

from typing import Annotated, Literal

from pydantic import Field, TypeAdapter

from fidim_lab.app.service.commands import PROTOCOL, Message


class Welcome(Message):
    """The service's answer to `Hello`; `History` follows."""

    type: Literal["welcome"] = "welcome"
    protocol: Literal["fidim-service/1"] = PROTOCOL
    you: int
    """number of this client"""
    run: str
    """name of the plan"""
    folder: str
    rig: str
    windows: tuple[str, ...]
    winches: tuple[str, ...]


class Happening(Message):
    """One thing that happened, numbered from 1 without gaps; `kind` as in the journal."""

    type: Literal["event"] = "event"
    number: int
    t: float
    """s, the service's monotonic clock"""
    wall: str
    """time of day, ISO 8601"""
    kind: Literal[
        "run-started",
        "step-started",
        "step-finished",
        "window-finished",
        "prompt",
        "guard-tripped",
        "guard-warned",
        "paused",
        "resumed",
        "run-finished",
        "lease",
        "e-stop",
        "reset",
        "model-checked",
    ]
    window: str = ""
    step: str = ""
    """the step's type"""
    text: str = ""
    outcome: str = ""
    """of a step, a window or the run; of `model-checked`: holds, does not hold, the ids of suspected effects, or
    nothing before there is enough to tell"""
    reason: str = ""
    values: tuple[float, ...] = ()
    """what the step read, SI"""


class History(Message):
    """What has happened before this client came, oldest first; a long one comes in pieces."""

    type: Literal["history"] = "history"
    events: tuple[Happening, ...]
    forgotten: int = 0
    """older events that are only in the journal"""
    more: bool = False
    """another piece follows, whose events go on from these"""


class WinchState(Message):
    """One winch."""

    name: str
    drive: str
    """CiA 402 state in words"""
    fault: str = ""
    length: float | None = None
    """m"""
    speed: float | None = None
    """m/s, positive pays out"""
    tension: float | None = None
    """N, from the motor current"""
    temperature: float | None = None
    """°C, where the drive reports it"""
    following_error: float | None = None
    """m, where the drive reports it"""
    heartbeat_age: float | None = None
    """s since the drive's heartbeat"""
    emergencies: int = 0
    """emergency messages of the drive so far"""
    lost: int = 0
    """bus cycles so far that brought no sample"""
    age: float | None = None
    """s since the sample; None: never reported"""
    length_limits: tuple[float, float] | None = None
    tension_limits: tuple[float, float]


class MocapState(Message):
    """Motion capture."""

    rate: float
    """Hz, as configured"""
    measured_rate: float
    """Hz, during the last second"""
    latency: float | None = None
    """s, where the source can know it"""
    age: float | None = None
    """s since the newest frame"""
    position: tuple[float, float, float] | None = None
    """main marker, m; None where occluded"""
    markers_seen: int = 0
    counters: dict[str, int]
    """frames received, lost, late, doubled, malformed so far"""


class BusState(Message):
    """The CAN bus, where there is one."""

    load: float | None = None
    """part of its capacity during the last second"""
    frames: float | None = None
    """a second"""


class GuardState(Message):
    """One guard."""

    name: str
    state: Literal["armed", "tripped", "warning", "disarmed"]
    reaction: str
    why: str = ""


class StepState(Message):
    """What is being done."""

    number: int
    step: str
    """its type"""
    window: str
    text: str
    phase: str
    fraction: float
    """0 to 1"""
    left: float
    """s to the end of the run, learnt from how long things took so far"""


class EquilibriumState(Message):
    """One row of the table of windows."""

    window: str
    role: str
    state: Literal["waiting", "current", "done"]
    verdict: str = ""
    """pass, marginal, skipped, fail; empty before"""
    reason: str = ""
    attempts: int = 0
    margin: float | None = None
    """N that the cable nearest to a tension limit is away from it, at rest"""
    amplitude: float | None = None
    """m, peak to peak of the last recording"""


class Status(Message):
    """All that is known, ten times a second."""

    type: Literal["state"] = "state"
    t: float
    wall: str
    phase: Literal["idle", "running", "paused", "stopping", "ended"]
    latched: bool
    """the emergency stop is latched: no motion before it is reset"""
    latched_why: str = ""
    commanding: int | None = None
    """number of the client that has the lease"""
    commander: str = ""
    """what that client calls itself, with its number"""
    watching: int = 0
    """clients"""
    step: StepState | None = None
    winches: tuple[WinchState, ...]
    mocap: MocapState
    bus: BusState
    guards: tuple[GuardState, ...]
    equilibria: tuple[EquilibriumState, ...]
    loop_late: float = 0.0
    """s, the longest that the control loop was late during the last second"""
    prompt: int | None = None
    """number of the open prompt"""


class Question(Message):
    """A prompt that waits for its answer; told again to a client that comes late."""

    type: Literal["prompt"] = "prompt"
    number: int
    kind: str
    window: str
    text: str
    choices: tuple[str, ...]
    displacement: tuple[float, ...] = ()
    """m, wanted of the main marker's x, y"""
    default: str = ""
    """what is answered where nobody does"""
    default_after: float | None = None
    """s"""


class PromptClosed(Message):
    """A prompt has its answer, or is no longer asked."""

    type: Literal["prompt-closed"] = "prompt-closed"
    number: int
    choice: str = ""
    """empty: withdrawn"""
    by: str = ""


class Samples(Message):
    """What came since the last batch, one row a frame: ten batches a second while clients want them."""

    type: Literal["samples"] = "samples"
    window: str
    """that is being recorded; empty between recordings"""
    attempt: int = 0
    t: tuple[float, ...]
    positions: tuple[tuple[float, float, float] | None, ...]
    """main marker, m"""
    tensions: tuple[tuple[float | None, ...], ...]
    """N, by winch"""
    lengths: tuple[tuple[float | None, ...], ...]
    """m, by winch"""


class Answer(Message):
    """What came of a command."""

    type: Literal["answer"] = "answer"
    id: int
    ok: bool
    says: str = ""
    """why not, or what was done"""
    code: str = ""
    """of a reset, to be sent back"""


class Refusal(Message):
    """A line that is no message, or a client that may not come in; the service closes after it."""

    type: Literal["refusal"] = "refusal"
    says: str


class Bye(Message):
    """The service ends."""

    type: Literal["bye"] = "bye"
    says: str
    exit_code: int


ToClient = Annotated[
    Welcome | Happening | History | Status | Question | PromptClosed | Samples | Answer | Refusal | Bye,
    Field(discriminator="type"),
]

TO_CLIENT: TypeAdapter[
    Welcome | Happening | History | Status | Question | PromptClosed | Samples | Answer | Refusal | Bye
] = TypeAdapter(ToClient)
