"""docs/messages.md, made from the models: `python -m fidim_lab.app.service.reference > docs/messages.md`."""

import sys
from typing import Any, get_args

from fidim_lab.app.formats.schema_words import default_words, one_line, type_words
from fidim_lab.app.service.commands import PROTOCOL, Command, Message, ToService
from fidim_lab.app.service.messages import ToClient

INTRODUCTION = f"""# Messages of the service, `{PROTOCOL}`

Made from `commands.py` and `messages.py` in `fidim_lab/app/service` by `python -m fidim_lab.app.service.reference`;
a test compares them.

A service (`fidim run`) listens at a Unix socket that only its user can open; `fidim run --tcp PORT` adds 127.0.0.1 with
a token. Both sides send JSON objects, UTF-8, one a line. A client says `hello` first, and gets `welcome`, `history`, a
`state` and, where a question is open, its `prompt`. From then on it hears everything, states and samples ten times a
second, and may send commands; each has one `answer` with its number. A line that is no message of this page gets a
`refusal`, and the connection is closed; nothing else changes. A client that does not read is dropped after some 2 MB;
of one that sends more than 20 commands a second (40 at once) the rest is read when their time comes. A line has 32 kB
at most. 32 clients have places at the socket and 16 on TCP, where who has not said hello makes room for who comes.

All texts end on terminals, so both sides make them printable when they arrive: line ends and tabs become spaces, other
control characters and direction marks their codes (`\\x1b`). A client's name is cut to 40 characters, a reason to 300.

Any number may watch, one may command (`take-lease`); `e-stop` and the answers to prompts are anybody's. The emergency
stop is latched when a service begins, and reset in two steps. Numbers are SI. Keys without a default must be there;
unknown keys are an error. A new key or message is a new version of the protocol.

From Python, `fidim_lab.app.service.client` does all this:

```python
async with connect(path, name="my script") as service:
    await service.take_lease()
    await service.require(Pause(reason="lunch"))
    async for message in service:
        ...
```
"""


def messages_page() -> str:
    """The whole page."""
    parts = [INTRODUCTION, "## What a client says\n"]
    parts += [_section(model, "type") for model in _members(ToService)]
    parts.append("## Commands\n\nThe `command` of a `command` message.\n")
    parts += [_section(model, "name") for model in _members(Command)]
    parts.append("## What a service says\n")
    parts += [_section(model, "type") for model in _members(ToClient)]
    parts.append("## Parts of messages\n")
    parts += [_section(model, "") for model in _parts()]
    return "\n".join(parts)


def _members(union: Any) -> tuple[type[Message], ...]:
    return get_args(get_args(union)[0])


def _parts() -> list[type[Message]]:
    """Models that only occur inside others, in the order of the file."""
    top = {*_members(ToService), *_members(ToClient), *_members(Command)}
    return [model for model in Message.__subclasses__() if model not in top]


def _section(model: type[Message], tag: str) -> str:
    schema = model.model_json_schema()
    title = f"`{model.model_fields[tag].default}`" if tag else model.__name__
    lines = [f"### {title}\n", one_line(model.__doc__ or "") + "\n"]
    rows = [_row(name, field, schema) for name, field in schema["properties"].items() if name != tag]
    if rows:
        lines += ["| key | type | default | |", "|---|---|---|---|", *rows, ""]
    return "\n".join(lines)


def _row(name: str, field: dict[str, Any], schema: dict[str, Any]) -> str:
    says = one_line(field.get("description", ""))
    return f"| `{name}` | {type_words(field)} | {default_words(name, field, schema)} | {says} |"


if __name__ == "__main__":
    sys.stdout.write(messages_page())
