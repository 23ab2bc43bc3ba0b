"""Messages of a client to a service: hello, then commands. `messages` has those of the service."""

from functools import partial
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, TypeAdapter, field_validator

from fidim_lab.say import printable

PROTOCOL = "fidim-service/1"
REASON = 300
"""characters of a reason; a longer one is cut, so that no stop is refused because of its text"""
NAME = 40
"""characters of a client's name, which is shown in one line with what it did"""

Text = Annotated[str, AfterValidator(partial(printable, longest=REASON))]
Name = Annotated[str, AfterValidator(partial(printable, longest=NAME))]


class Message(BaseModel):
    """Base of all messages: frozen; unknown keys are refused; texts are made printable, since terminals show them."""

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
    """Become the one client that may command. Refused while another client has the lease, unless `force` is true."""

    name: Literal["take-lease"] = "take-lease"
    force: bool = False
    """take the lease from the client that has it; that client is informed"""


class ReleaseLease(Message):
    """Give up the lease, so that another client may command."""

    name: Literal["release-lease"] = "release-lease"


class Start(Message):
    """Begin the run. The emergency stop must have been reset before."""

    name: Literal["start"] = "start"


class Pause(Message):
    """Stop all winches on their ramp and hold them, with power on."""

    name: Literal["pause"] = "pause"
    reason: Text = ""
    """for the journal"""


class Resume(Message):
    """Continue the run, after checking that the robot is where it was held."""

    name: Literal["resume"] = "resume"


class Skip(Message):
    """Leave out the present window and continue with the next."""

    name: Literal["skip"] = "skip"
    reason: Annotated[Text, Field(min_length=1)]
    """for the journal"""


class Retry(Message):
    """Repeat the present window, or its recording."""

    name: Literal["retry"] = "retry"
    reason: Text = ""
    """for the journal"""


class Abort(Message):
    """End the run now; the robot is held."""

    name: Literal["abort"] = "abort"
    reason: Annotated[Text, Field(min_length=1)]
    """for the journal"""


class EmergencyStop(Message):
    """Quick-stop all winches at once and latch the stop. Every client may, without the lease."""

    name: Literal["e-stop"] = "e-stop"
    reason: Text = ""
    """for the journal, and for whoever resets the stop"""


class Reset(Message):
    """Reset the latched emergency stop in two steps: without a code the answer gives one; with it the stop is reset."""

    name: Literal["reset"] = "reset"
    code: Text = ""
    """of the answer to the first `reset`"""


class AnswerPrompt(Message):
    """Answer the prompt with this number. Every client may; the first answer counts."""

    name: Literal["answer"] = "answer"
    prompt: int
    """number of the prompt"""
    choice: Text
    """one of its choices"""


class Shutdown(Message):
    """End the service. Refused during a run; abort it first."""

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
    """The first message of a client."""

    type: Literal["hello"] = "hello"
    protocol: Text = PROTOCOL
    client: Name = ""
    """a name that journals and other clients show, such as "fidim run", "tui" or "lab script" """
    token: Text = ""
    """needed over TCP; it is in the file that the service names when it starts"""
    samples: bool = True
    """true: send `samples` messages to this client"""


class Request(Message):
    """A command, with a number that the client chooses and the `answer` repeats."""

    type: Literal["command"] = "command"
    id: int
    command: Command


ToService = Annotated[Hello | Request, Field(discriminator="type")]

TO_SERVICE: TypeAdapter[ToService] = TypeAdapter(ToService)
