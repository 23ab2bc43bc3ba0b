"""Reading JSON files as what they should hold: the first mistake as a FileError with its place."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ConfigDict, ValidationError

from fidim_lab.data.files.input_file import JSON_LIMIT, read_json
from fidim_lab.data.files.mistakes import first_mistake
from fidim_lab.errors import FileError

T = TypeVar("T")
STRICT = ConfigDict(extra="forbid", allow_inf_nan=False)
"""for a dataclass that a file holds as it is: its `__pydantic_config__`"""


def read_json_as(path: Path, validate: Callable[[Any], T], limit: int = JSON_LIMIT) -> T:
    """A JSON file as `validate` makes it (`Model.model_validate`). Raises FileError with the key that is wrong."""
    return validated_json(path, read_json(path, limit), validate)


def validated_json(path: Path, found: Any, validate: Callable[[Any], T]) -> T:
    """What was read of a file as `validate` makes it. Raises FileError with the key that is wrong."""
    try:
        return validate(found)
    except ValidationError as error:
        raise FileError(path, *first_mistake(error.errors(include_url=False), found)) from None
