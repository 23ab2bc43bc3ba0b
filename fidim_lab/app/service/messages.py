"""Messages of a service, "fidim-service/1": one JSON object per line, in UTF-8, each ended by a newline.

Every message is one of these models (those of a client are in `commands`); an unknown key or type is an error. Numbers
are in SI units. docs/messages.md is made from both files.
"""

from typing import Annotated, Literal

from pydantic import Field, TypeAdapter

from fidim_lab.app.service.commands import PROTOCOL, Message


class Welcome(Message):
    """The service's answer to `hello`; `history` follows."""

    type: Literal["welcome"] = "welcome"
    protocol: Literal["fidim-service/1"] = PROTOCOL
    you: int
    """number of this client"""
    run: str
    """name of the plan"""
    folder: str
    """run folder"""
    rig: str
    """name of the rig file"""
    windows: tuple[str, ...]
    """ids, in the order of the plan"""
    winches: tuple[str, ...]
    """names, in the order of the cables"""


class Happening(Message):
    """An event of the run, numbered from 1 without gaps; `kind` is that of the journal."""

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
    """id of the window that it belongs to"""
    step: str = ""
    """type of the step"""
    text: str = ""
    """what happened, in words"""
    outcome: str = ""
    """of a step, a window or the run; of `model-checked`: holds, does not hold, the ids of suspected effects, or
    empty while the data are too few"""
    reason: str = ""
    """why the outcome is what it is"""
    values: tuple[float, ...] = ()
    """measured values of the step, in SI units"""


class History(Message):
    """Events before this client connected, oldest first; a long history comes in several messages."""

    type: Literal["history"] = "history"
    events: tuple[Happening, ...]
    forgotten: int = 0
    """number of older events, which are only in the journal"""
    more: bool = False
    """another `history` message follows, with later events"""


class WinchState(Message):
    """State of one winch."""

    name: str
    """as in the rig file"""
    drive: str
    """CiA 402 state of the drive, in words"""
    fault: str = ""
    """the drive's fault in words; empty: none"""
    length: float | None = None
    """m, of its cable"""
    speed: float | None = None
    """m/s; positive: the cable is paid out"""
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
    """bus cycles so far without a sample"""
    age: float | None = None
    """s since the newest sample; null: no sample yet"""
    length_limits: tuple[float, float] | None = None
    """m"""
    tension_limits: tuple[float, float]
    """N"""


class MocapState(Message):
    """State of the motion capture."""

    rate: float
    """Hz, as configured"""
    measured_rate: float
    """Hz, during the last second"""
    latency: float | None = None
    """s, where the source can measure it"""
    age: float | None = None
    """s since the newest frame"""
    position: tuple[float, float, float] | None = None
    """m, of the main marker; null: not seen"""
    markers_seen: int = 0
    """in the newest frame"""
    counters: dict[str, int]
    """number of frames received, lost, late, doubled and malformed so far"""


class BusState(Message):
    """State of the CAN bus, where there is one."""

    load: float | None = None
    """fraction of its capacity used during the last second"""
    frames: float | None = None
    """frames per second"""


class GuardState(Message):
    """State of one guard."""

    name: str
    state: Literal["armed", "tripped", "warning", "disarmed"]
    reaction: str
    """as in the rig file, such as hold or quick-stop"""
    why: str = ""
    """why it tripped or warns"""


class StepState(Message):
    """The step that is being carried out."""

    number: int
    """counted from the start of the run"""
    step: str
    """type of the step"""
    window: str
    """id of the window that it belongs to"""
    text: str
    """what it does, in words"""
    phase: str
    """a word for it, such as moving, settling, recording"""
    fraction: float
    """part of the step that is done, 0 to 1"""
    left: float
    """s to the end of the run, estimated from the duration of earlier steps"""


class EquilibriumState(Message):
    """State of one window of the plan."""

    window: str
    """id"""
    role: str
    """identify, validate or test"""
    state: Literal["waiting", "current", "done"]
    verdict: str = ""
    """pass, marginal, skipped or fail; empty: not judged yet"""
    reason: str = ""
    attempts: int = 0
    """recordings so far"""
    margin: float | None = None
    """N, at rest: the smallest distance of any cable's tension from a limit"""
    amplitude: float | None = None
    """m, peak to peak, of the last recording"""


class Status(Message):
    """State of run and rig, ten times a second."""

    type: Literal["state"] = "state"
    t: float
    """s, the service's monotonic clock"""
    wall: str
    """time of day, ISO 8601"""
    phase: Literal["idle", "running", "paused", "stopping", "ended"]
    latched: bool
    """true: the emergency stop is latched, and nothing moves before it is reset"""
    latched_why: str = ""
    """who stopped, and why"""
    commanding: int | None = None
    """number of the client that has the lease"""
    commander: str = ""
    """name of that client, with its number"""
    watching: int = 0
    """number of connected clients"""
    step: StepState | None = None
    winches: tuple[WinchState, ...]
    mocap: MocapState
    bus: BusState
    guards: tuple[GuardState, ...]
    equilibria: tuple[EquilibriumState, ...]
    loop_late: float = 0.0
    """s, largest delay of the control loop during the last second"""
    prompt: int | None = None
    """number of the open prompt"""


class Question(Message):
    """A prompt that waits for an answer; also sent to a client that connects later."""

    type: Literal["prompt"] = "prompt"
    number: int
    """for the answer"""
    kind: str
    """as in `fidim run --answer`"""
    window: str
    """id"""
    text: str
    """the question"""
    choices: tuple[str, ...]
    """possible answers"""
    displacement: tuple[float, ...] = ()
    """m, requested displacement of the main marker in x and y"""
    default: str = ""
    """the answer that is given if no client answers"""
    default_after: float | None = None
    """s until that answer is given; null: never"""


class PromptClosed(Message):
    """A prompt was answered or withdrawn."""

    type: Literal["prompt-closed"] = "prompt-closed"
    number: int
    choice: str = ""
    """the answer; empty: withdrawn"""
    by: str = ""
    """who answered"""


class Samples(Message):
    """Samples since the last message, one row per camera frame; ten messages a second to clients that want them."""

    type: Literal["samples"] = "samples"
    window: str
    """id of the window that is being recorded; empty between recordings"""
    attempt: int = 0
    """number of the recording of this window"""
    t: tuple[float, ...]
    """s, the service's monotonic clock"""
    positions: tuple[tuple[float, float, float] | None, ...]
    """m, of the main marker; null: not seen"""
    tensions: tuple[tuple[float | None, ...], ...]
    """N, one per winch"""
    lengths: tuple[tuple[float | None, ...], ...]
    """m, one per winch"""


class Answer(Message):
    """The service's answer to a command."""

    type: Literal["answer"] = "answer"
    id: int
    """number of the command"""
    ok: bool
    """true: it was carried out"""
    says: str = ""
    """what was done, or why not"""
    code: str = ""
    """after `reset` without a code: the code to send back"""


class Refusal(Message):
    """A line was not a valid message, or the client is not admitted; the service then closes the connection."""

    type: Literal["refusal"] = "refusal"
    says: str
    """why"""


class Bye(Message):
    """The service ends; its last message."""

    type: Literal["bye"] = "bye"
    says: str
    """how the run ended"""
    exit_code: int
    """as of `fidim run`"""


ToClient = Annotated[
    Welcome | Happening | History | Status | Question | PromptClosed | Samples | Answer | Refusal | Bye,
    Field(discriminator="type"),
]

TO_CLIENT: TypeAdapter[ToClient] = TypeAdapter(ToClient)
