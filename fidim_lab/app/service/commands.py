"""What a client may say to a service: hello, then commands. `messages` has what the service says."""

from functools import partial
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, TypeAdapter, field_validator

from fidim_lab.say import printable

PROTOCOL = "fidim-service/1"
REASON = 300
"""characters of a reason; a longer one is cut, for a stop is never refused over its words"""
NAME = 40
"""characters of a client's name, on a line with what it did"""

Text = Annotated[str, AfterValidator(partial(printable, longest=REASON))]
Name = Annotated[str, AfterValidator(partial(printable, longest=NAME))]


class Message(BaseModel):
    """Base of all messages: frozen, unknown keys refused, and all text printable, since terminals show it."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, use_attribute_docstrings=True)

    @field_validator("*")
    @classmethod
    def _printable(cls, value: Any) -> Any:
        if isinstance(value, str):
            return printable(value)
        if isinstance(value, tuple) and value and isinstance(value[0], str):
            return tuple(map(printable, value))
        return value


class TakeLease(Message):
    """Become the one client that may command. Refused while another has the lease, unless `force`."""

    name: Literal["take-lease"] = "take-lease"
    force: bool = False
    """take it from whoever has it; that client is told"""


class ReleaseLease(Message):
    """Let another client command."""

    name: Literal["release-lease"] = "release-lease"


class Start(Message):
    """Begin the run. The emergency stop must have been reset."""

    name: Literal["start"] = "start"


class Pause(Message):
    """Stop on the ramp and hold, with power on."""

    name: Literal["pause"] = "pause"
    reason: Text = ""


class Resume(Message):
    """Verify that the robot is where it was held, then go on."""

    name: Literal["resume"] = "resume"


class Skip(Message):
    """Go on without the present window."""

    name: Literal["skip"] = "skip"
    reason: Annotated[Text, Field(min_length=1)]


class Retry(Message):
    """Do the present window, or its recording, once more."""

    name: Literal["retry"] = "retry"
    reason: Text = ""


class Abort(Message):
    """End the run here; the robot is held."""

    name: Literal["abort"] = "abort"
    reason: Annotated[Text, Field(min_length=1)]


class EmergencyStop(Message):
    """Quick-stop all winches at once and latch. Anybody may, without lease."""

    name: Literal["e-stop"] = "e-stop"
    reason: Text = ""


class Reset(Message):
    """Reset the latched emergency stop, in two steps: without code, the answer has one; with that code, it is done."""

    name: Literal["reset"] = "reset"
    code: Text = ""


class AnswerPrompt(Message):
    """Answer the prompt of this number. Any client may; the first answer counts."""

    name: Literal["answer"] = "answer"
    prompt: int
    choice: Text


class Shutdown(Message):
    """End the service. Refused while a run goes on (abort it first)."""

    name: Literal["shutdown"] = "shutdown"


Command = Annotated[
    TakeLease
    | ReleaseLease
    | Start
    | Pause
    | Resume
    | Skip
    | Retry
    | Abort
    | EmergencyStop
    | Reset
    | AnswerPrompt
    | Shutdown,
    Field(discriminator="name"),
]


class Hello(Message):
    """The first line of a client."""

    type: Literal["hello"] = "hello"
    protocol: Text = PROTOCOL
    client: Name = ""
    """a name for journals and other people's screens: "fidim run", "tui", "lab script" """
    token: Text = ""
    """needed on TCP; as in the file that the service names when it starts"""
    samples: bool = True
    """whether live samples are wanted"""


class Request(Message):
    """A command with a number of the client's choice, which its `Answer` repeats."""

    type: Literal["command"] = "command"
    id: int
    command: Command


ToService = Annotated[Hello | Request, Field(discriminator="type")]

TO_SERVICE: TypeAdapter[Hello | Request] = TypeAdapter(ToService)
