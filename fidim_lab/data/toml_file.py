"""Reading TOML files with manners: every error names the file, the table and the key, all mistakes at once."""

import tomllib
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from fidim_lab.errors import FileError

Schema = TypeVar("Schema", bound="Table")


class Table(BaseModel):
    """A TOML table whose keys are all known: an unknown one is an error."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)


def read_text(path: Path) -> str:
    """The text of a file. Raises FileError where it is missing, unreadable or not UTF-8."""
    try:
        return path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise FileError(path, "", "no such file") from None
    except IsADirectoryError:
        raise FileError(path, "", "is a folder, a file was expected") from None
    except UnicodeDecodeError as error:
        raise FileError(path, f"byte {error.start}", "is not UTF-8 text") from None
    except OSError as error:
        raise FileError(path, "", f"cannot be read: {error.strerror}") from None


def read_toml(path: Path, schema: type[Schema], wanted_format: str) -> Schema:
    """A TOML file as its schema.

    `wanted_format` is the value that the key `format` must have. Raises FileError naming the places of all mistakes.
    """
    try:
        table = tomllib.loads(read_text(path))
    except tomllib.TOMLDecodeError as error:
        raise FileError(path, "", f"is not TOML: {error}") from None
    return validated(path, table, schema, wanted_format)


def validated(path: Path, table: dict[str, Any], schema: type[Schema], wanted_format: str) -> Schema:
    """What was read of a file as its schema. Raises FileError naming the places of all mistakes."""
    found = table.get("format")
    if found != wanted_format:
        what = "is missing" if found is None else f"is {found!r}"
        raise FileError(path, "format", f'{what}; this version reads "{wanted_format}"')
    try:
        return schema.model_validate(table)
    except ValidationError as error:
        raise FileError(path, "", "; ".join(_sentence(e) for e in error.errors())) from None


def _sentence(error: Any) -> str:
    place = _place(error["loc"])
    found = error["input"]
    match error["type"]:
        case "extra_forbidden":
            return f"{place}: unknown key"
        case "missing" if isinstance(found, list):  # a tuple that ended too early
            return f"{_place(error['loc'][:-1])}: {len(found)} numbers are too few"
        case "missing":
            return f"{place}: is missing"
        case "too_long":
            return f"{place}: {error['ctx']['actual_length']} values, at most {error['ctx']['max_length']} are allowed"
        case "value_error":
            return f"{place}: {error['ctx']['error']}"
        case _:
            shown = repr(found)
            return f"{place}: {error['msg']}, found {shown if len(shown) < 60 else shown[:57] + '...'}"


def _place(location: tuple[int | str, ...]) -> str:
    """('cable', 2, 'radius') → 'cable 3, radius': people count from one."""
    words: list[str] = []
    for part in location:
        if isinstance(part, int) and words:
            words[-1] += f" {part + 1}"
        else:
            words.append(str(part))
    return ", ".join(words) or "file"
