"""docs/messages.md, made from the models: `python -m docs.tools.messages > docs/messages.md`."""

import sys
from typing import Any, get_args

from docs.tools.schema_words import default_words, one_line, type_words
from fidim_lab.app.service.commands import PROTOCOL, Command, Message, ToService
from fidim_lab.app.service.messages import ToClient

INTRODUCTION = f"""# Messages of the service, `{PROTOCOL}`

Made from `commands.py` and `messages.py` in `fidim_lab/app/service` by `python -m docs.tools.messages`;
a test compares them.

A service (`fidim run`) listens on a Unix socket that only its user can open; `fidim run --tcp PORT` adds a port of
127.0.0.1, for which a client needs a token. Both sides send JSON objects in UTF-8, one per line.

- The client first sends `hello`. It receives `welcome`, `history`, a `state` and, if a prompt is open, the `prompt`.
- Then it receives every message, with states and samples ten times a second. It may send commands; each command gets
  one `answer` with the same number.
- A line that is not a message of this page gets a `refusal`, and the connection is closed. Nothing else changes.

Limits: a line has at most 32 kB. A client that does not read is disconnected when some 2 MB wait for it. If a client
sends more than 20 commands a second (40 at once), the others are read later. At most 32 clients can connect to the
socket and 16 over TCP; one that has not sent `hello` is disconnected when a new one needs its place.

Texts are shown on terminals, so both sides make them printable on arrival: line ends and tabs become spaces, other
control characters and direction marks become their codes (`\\x1b`). The name of a client is cut to 40 characters, a
reason to 300.

Any number of clients may watch, one may command (`take-lease`). Every client may send `e-stop` and answer prompts. The
emergency stop is latched when a service begins, and is reset in two steps. Numbers are in SI units. A key without a
default is required; an unknown key is an error. A new key or message means a new version of the protocol.

In Python, use `fidim_lab.app.service.client`:

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
    parts = [INTRODUCTION, "## Messages of a client\n"]
    parts += [_section(model, "type") for model in _members(ToService)]
    parts.append("## Commands\n\nEach is the `command` of a `command` message.\n")
    parts += [_section(model, "name") for model in _members(Command)]
    parts.append("## Messages of a service\n")
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
