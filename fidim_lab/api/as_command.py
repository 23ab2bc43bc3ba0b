"""A function of the interface is its command in Python: the same bounds, and messages that name arguments."""

import inspect
import re
from collections.abc import Callable
from functools import wraps
from math import isfinite
from numbers import Real
from typing import Any, ParamSpec, TypeVar

import click
from threadpoolctl import threadpool_limits

from fidim_lab.errors import FidimError, SetupError

P = ParamSpec("P")
R = TypeVar("R")

OTHER_NAMES = {"poses": "pose_from", "validation": "validate"}
"""parameter of a command → name here, where the command's own is no word"""
_ARGUMENTS = {"all": "everything"}
"""option → argument, where they differ by more than the hyphens"""
_OPTION = re.compile(r"(fidim [a-z-]+(?: (?![A-Z][a-z])[^\s,;:]+)*)|(?<![\w-])--([a-z][a-z-]*[a-z])")
"""what is to be typed in a terminal, which stays as it is; or an option"""


def as_command(function: Callable[P, R]) -> Callable[P, R]:
    """Bounds and choices as the command of the function's name has them; raises SetupError that names the argument.

    Other errors pass, with options (--out) written as arguments (out). Meanwhile, as in the command, BLAS has one
    thread: all our matrices are small, and its threads only wait for each other (a fit took four times as long).
    """
    signature = inspect.signature(function)

    @wraps(function)
    def called(*args: P.args, **kwargs: P.kwargs) -> R:
        given = signature.bind(*args, **kwargs).arguments
        try:
            _check(function.__name__, given)
            with threadpool_limits(limits=1, user_api="blas"):
                return function(*args, **kwargs)
        except FidimError as error:
            error.message, error.hint = in_python(error.message), in_python(error.hint)
            raise

    return called


def in_python(text: str) -> str:
    """Options of a message as the arguments that they are in Python; whole commands stay."""

    def argument(found: re.Match[str]) -> str:
        return found[1] or _ARGUMENTS.get(found[2], found[2].replace("-", "_"))

    return _OPTION.sub(argument, text)


def _check(command: str, given: dict[str, object]) -> None:
    """Raises SetupError for a value that the command's option of this name would refuse."""
    from fidim_lab.app import cli

    for option in cli.fidim.commands[command].params:
        name = OTHER_NAMES.get(option.name or "", option.name or "")
        if name in given and given[name] is not None:
            _allowed(name, given[name], option.type)


def _allowed(name: str, value: Any, kind: Any) -> None:
    if isinstance(kind, click.Choice):
        if value not in kind.choices:
            known = ", ".join(str(choice) for choice in kind.choices)
            raise SetupError(f"There is no {name}={value!r}; available: {known}.")
        return
    whole = isinstance(kind, click.types.IntParamType)
    if not whole and not isinstance(kind, click.types.FloatParamType):
        return
    expected = "a whole number" if whole else "a number"
    if not _is_number(value) or (whole and value != int(value)):
        raise SetupError(f"{name}={value!r}: {expected} is expected.")
    try:
        kind.convert(value, None, None)
    except click.BadParameter as error:
        _, _, wrong = error.message.partition(" is ")
        raise SetupError(f"{name}={value!r} is {wrong}") from error


def _is_number(value: Any) -> bool:
    """numpy's count; truth values do not."""
    return not isinstance(value, bool) and isinstance(value, Real) and isfinite(value)
