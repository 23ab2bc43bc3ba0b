"""docs/messages.md, made from the models: `python -m fidim_lab.app.service.reference > docs/messages.md`."""

import json
import re
import sys
from typing import Any, get_args

from fidim_lab.app.service.commands import PROTOCOL, Command, Message, ToService
from fidim_lab.app.service.messages import ToClient

INTRODUCTION = f"""# Messages of the service, `{PROTOCOL}`

Made from `commands.py` and `messages.py` in `fidim_lab/app/service` by `python -m fidim_lab.app.service.reference`;
a test compares them.

A service (`fidim run`) listens at a Unix socket that only its user can open; `fidim run --tcp PORT` adds 127.0.0.1 with
a token. Both sides send JSON objects, UTF-8, one a line. A client says `hello` first, and gets `welcome`, `history`, a
`state` and, where a question is open, its `prompt`. From then on it hears everything, states and samples ten times a
second, and may send commands; each has one `answer` with its number. A line that is no message of this page gets a
`refusal`, and the connection is closed; nothing else changes. A client that does not read is dropped after some 2 MB.

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
    lines = [f"### {title}\n", _one_line(model.__doc__ or "") + "\n"]
    rows = [_row(name, field, schema) for name, field in schema["properties"].items() if name != tag]
    if rows:
        lines += ["| key | type | default | |", "|---|---|---|---|", *rows, ""]
    return "\n".join(lines)


def _row(name: str, field: dict[str, Any], schema: dict[str, Any]) -> str:
    default = "" if name in schema.get("required", ()) else f"`{_json(field.get('default'))}`"
    return f"| `{name}` | {_type(field)} | {default} | {_one_line(field.get('description', ''))} |"


def _one_line(text: str) -> str:
    return re.sub(r"\s+", " ", text).strip()


def _type(field: dict[str, Any]) -> str:
    match field:
        case {"$ref": str(ref)}:
            return ref.rpartition("/")[2]
        case {"const": value}:
            return f"`{_json(value)}`"
        case {"enum": list(values)}:
            return " or ".join(f"`{_json(value)}`" for value in values)
        case {"anyOf": list(kinds)}:
            return " or ".join(dict.fromkeys(_type(kind) for kind in kinds))
        case {"oneOf": list()}:
            return "one of the commands below"
        case {"type": "array", "prefixItems": list(items)}:
            return "[" + ", ".join(_type(item) for item in items) + "]"
        case {"type": "array", "items": dict(item)}:
            return f"list of {_type(item)}"
        case {"type": "object", "additionalProperties": dict(item)}:
            return f"object of {_type(item)}"
        case {"type": str(kind)}:
            return kind
        case _:
            return ""


def _json(value: object) -> str:
    return json.dumps(value)


if __name__ == "__main__":
    sys.stdout.write(messages_page())
