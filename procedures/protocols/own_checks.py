"""Mistakes in a laboratory's own procedure, reported before anything moves, with file, line and step.

`unyielded` reads the file; `mistake` looks at a step that it yields.
"""

import ast
import inspect
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields
from enum import Enum
from functools import cache
from numbers import Integral, Real
from types import ModuleType, UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

from procedures.protocols.experiment import Lab
from procedures.steps import Step

LENGTHS = ("lengths", "start")
"""fields of steps that have a length for each cable"""
MOTION = ("speed", "acceleration")


def unyielded(source: str, module: ModuleType) -> Iterator[tuple[int, str]]:
    """Line and what is wrong, of each step or generator that the file makes and drops: nothing would be done."""
    tree = ast.parse(source)
    read = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load)}
    for node in ast.walk(tree):
        match node:
            case ast.Expr(value=ast.Call() as call):
                pass
            case ast.Assign(targets=[ast.Name(id=name)], value=ast.Call() as call) if name not in read:
                pass
            case _:
                continue
        made = _resolved(call.func, module)
        if isinstance(made, type) and issubclass(made, Step):
            yield (
                node.lineno,
                f"{made.__name__}(…) is created but not yielded, so it is never executed; write `yield` before it",
            )
        elif inspect.isgeneratorfunction(made):
            yield node.lineno, f"{made.__name__}(…) is not used, so it does nothing; write `yield from` before it"


def _resolved(node: ast.expr, module: ModuleType) -> object:
    match node:
        case ast.Name(id=name):
            return getattr(module, name, None)
        case ast.Attribute(value=owner, attr=name):
            return getattr(_resolved(owner, module), name, None)
        case _:
            return None


def mistake(step: Step, lab: Lab, windows: Sequence[str]) -> str:
    """What a step cannot mean, as a sentence without its full stop; empty where nothing is wrong.

    windows: ids that the plan has.
    """
    kind = type(step).__name__
    hints = _hints(type(step))
    for field in fields(step):
        value = getattr(step, field.name)
        if not _fits(value, hints[field.name]):
            return f"{kind}: {field.name} is {shown(value)}; {_wanted(value, hints[field.name])} is needed"
        if field.name in MOTION and value <= 0:
            return f"{kind}: {field.name} is {value:g}; more than 0 is needed"
        if field.name in LENGTHS and value is not None and len(value) != lab.robot.n:
            return f"{kind}: {field.name} has {len(value)} lengths, the robot has {lab.robot.n} cables"
    if step.window and step.window not in windows:
        return f"{kind}: the plan has no window {step.window!r}; it has {', '.join(windows)}"
    if not step.seconds >= 0:
        return f"{kind}: it would take {step.seconds:g} s"
    return ""


@cache
def _hints(kind: type[Step]) -> Mapping[str, Any]:
    return get_type_hints(kind)


def _fits(value: object, wanted: Any) -> bool:
    origin, parts = get_origin(wanted), get_args(wanted)
    if origin in (Union, UnionType):
        return any(_fits(value, part) for part in parts)
    if origin is tuple:
        each = parts[:1] * len(value) if isinstance(value, tuple) and parts[1:] == (Ellipsis,) else parts
        return isinstance(value, tuple) and len(value) == len(each) and all(map(_fits, value, each))
    if wanted is float:
        return _number(value, Real) and math.isfinite(value)  # pyright: ignore[reportArgumentType]
    if wanted is int:
        return _number(value, Integral)
    kind = origin or wanted
    return not isinstance(kind, type) or isinstance(value, kind)


def _number(value: object, kind: type) -> bool:
    return isinstance(value, kind) and not isinstance(value, bool)


def _wanted(value: object, wanted: Any) -> str:
    if wanted is str and isinstance(getattr(value, "id", None), str):
        return f"its id ({value.id!r}, write `.id`)"  # pyright: ignore[reportAttributeAccessIssue]
    if wanted is str:
        return "text"
    if wanted is float:
        return "a finite number"
    if wanted is int:
        return "a whole number"
    if get_origin(wanted) is tuple:
        return "a tuple of finite numbers" if get_args(wanted)[:1] == (float,) else "a tuple"
    parts = [part for part in get_args(wanted) if part is not type(None)]
    if get_origin(wanted) in (Union, UnionType) and len(parts) == 1:
        return f"{_wanted(value, parts[0])} or None"
    if isinstance(wanted, type) and issubclass(wanted, Enum):
        return f"one of {', '.join(f'{wanted.__name__}.{one.name}' for one in wanted)} ({wanted.__module__})"
    return getattr(wanted, "__name__", str(wanted))


def shown(value: object) -> str:
    """A value for a message, or what kind of thing it is where that is long."""
    text = repr(value)
    return f"a {type(value).__name__}" if len(text) > 60 else text
