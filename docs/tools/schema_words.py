"""JSON schemas of pydantic models as words of a page: types, defaults."""

import json
import re
from typing import Any


def one_line(text: str) -> str:
    """Any white space as one blank."""
    return re.sub(r"\s+", " ", text).strip()


def default_words(name: str, field: dict[str, Any], schema: dict[str, Any]) -> str:
    """A property's default as JSON; empty where the property must be given."""
    return "" if name in schema.get("required", ()) else f"`{json.dumps(field.get('default'))}`"


def type_words(field: dict[str, Any]) -> str:
    """What a value may be, by its schema."""
    match field:
        case {"$ref": str(ref)}:
            return ref.rpartition("/")[2]
        case {"const": value}:
            return f"`{json.dumps(value)}`"
        case {"enum": list(values)}:
            return " or ".join(f"`{json.dumps(value)}`" for value in values)
        case {"anyOf": list(kinds)}:
            return " or ".join(dict.fromkeys(type_words(kind) for kind in kinds))
        case {"oneOf": list()}:
            return "one of the commands below"
        case {"type": "array", "prefixItems": list(items)}:
            return "[" + ", ".join(type_words(item) for item in items) + "]"
        case {"type": "array", "items": dict(item)}:
            return f"list of {type_words(item)}"
        case {"type": "object", "additionalProperties": dict(item)}:
            return f"object of {type_words(item)}"
        case {"type": str(kind)}:
            return kind
        case _:
            return ""
