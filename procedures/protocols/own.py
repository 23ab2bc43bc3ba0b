"""A laboratory's own procedure: a Python file with a generator function `procedure(lab)`.

What goes wrong in it is told with that file and its line: it is no bug of ours.
"""

import importlib.util
import sysconfig
import traceback
from collections.abc import Generator
from dataclasses import fields, is_dataclass
from pathlib import Path
from types import GeneratorType
from typing import Any

import procedures.steps
from fidim_lab.data.files.input_file import read_text
from fidim_lab.errors import FidimError, FileError, SetupError
from procedures.control import Intervention
from procedures.interruption import Aborted
from procedures.protocols.experiment import Lab, Make
from procedures.protocols.own_checks import mistake, shown, unyielded
from procedures.steps import Accept, Record, Result, Step, Steps

PACKAGES = ("drivers", "fidim_lab", "procedures", "sim_backends")
ROOT = Path(procedures.__file__).resolve().parents[1]
INSTALLED = (
    *(ROOT / package for package in PACKAGES),
    *(Path(sysconfig.get_path(name)).resolve() for name in ("stdlib", "purelib", "platlib")),
)
"""where no file is of a laboratory's own"""
MOST_STEPS = 200_000
"""of one procedure: two days of readings of 1 s; an endless list is refused after some seconds instead of never"""
HINT = "docs/procedures.md shows a procedure; --debug shows the full traceback."


def own_procedure(path: Path) -> Make:
    """The function `procedure` of a Python file. Raises SetupError where there is none, or the file is no Python."""
    spec = importlib.util.spec_from_file_location("fidim_own_procedure", path)
    if spec is None or spec.loader is None or not path.is_file():
        raise SetupError(f"{path}: no such Python file.")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        file, place = _place(path, error)
        raise FileError(file, place, f"cannot be imported: {type(error).__name__}: {error}.", hint=HINT) from error
    for line, wrong in unyielded(read_text(path), module):
        raise FileError(path, f"line {line}", f"{wrong}.", hint=HINT)
    function = getattr(module, "procedure", None)
    if not callable(function):
        raise SetupError(f"{path}: has no function `procedure(lab)` that yields steps (docs/procedures.md).")

    def make(lab: Lab) -> Steps:
        return _told(path, function, lab)

    return make


def _told(path: Path, function: Any, lab: Lab) -> Steps:
    """The file's steps. Raises FileError with file and line for a mistake in it, and for what is no step."""
    try:
        steps = function(lab)
        if not isinstance(steps, Generator):
            raise FileError(path, "procedure", f"gives {shown(steps)}; it must yield steps.", hint=HINT)
        yield from _steps(path, steps, lab)
    except (FidimError, Intervention, Aborted):
        raise
    except Exception as error:
        wrong = f"{type(error).__name__}: {error}.{_takes(error)}{_not_yielded(error)}"
        raise FileError(*_place(path, error), wrong, hint=HINT) from error


def _takes(error: Exception) -> str:
    """What a step takes that was made with other arguments; nothing of other errors."""
    name = str(error).partition(".__init__()")[0]
    kind = getattr(procedures.steps, name, None) if isinstance(error, TypeError) else None
    return f" {name} takes {', '.join(field.name for field in fields(kind))}." if is_dataclass(kind) else ""


def _not_yielded(error: Exception) -> str:
    """What to do where a step is asked for what only its result has; nothing of other errors."""
    if not isinstance(error, AttributeError):
        return ""
    step = error.obj
    if not isinstance(step, Step) or error.name not in {field.name for field in fields(Result)}:
        return ""
    return f" That is an attribute of its result: write `yield` before {type(step).__name__}(…)."


def _steps(path: Path, steps: Generator[Any, Result, None], lab: Lab) -> Steps:
    windows = [window.id for window in lab.plan.windows]
    number = 0
    recorded: set[str] = set()
    try:
        step = next(steps)
        while True:
            number += 1
            line = _yielding(path, steps)
            if number > MOST_STEPS:
                raise FileError(
                    path, line, f"more than {MOST_STEPS} steps without an end: is there an endless loop?", hint=HINT
                )
            if not isinstance(step, Step):
                how = ": write `yield from` before a generator" if isinstance(step, Generator) else ""
                raise FileError(path, line, f"yields {shown(step)}, which is not a step{how}.", hint=HINT)
            if wrong := mistake(step, lab, windows):
                raise FileError(path, line, f"step {number}, {wrong}.", hint=HINT)
            if beyond := lab.beyond(step):
                raise FileError(
                    path,
                    line,
                    f"step {number}, {'; '.join(beyond)}.",
                    hint="Nothing was started. Change the procedure.",
                )
            if isinstance(step, Record):
                recorded.add(step.window)
            if isinstance(step, Accept) and step.window not in recorded:
                wrong = f"step {number}, Accept: nothing of window {step.window} was recorded; yield Record before it"
                raise FileError(path, line, f"{wrong}.", hint=HINT)
            try:
                result = yield step
            except Intervention as word:
                step = steps.throw(word)
            else:
                step = steps.send(result)
    except StopIteration:
        return
    finally:
        steps.close()


def _yielding(path: Path, steps: Any) -> str:
    """Where in the file a step has just been yielded: in a generator of the same file, too, that is yielded from."""
    inner = steps.gi_yieldfrom
    if isinstance(inner, GeneratorType) and inner.gi_code.co_filename == str(path):
        return _yielding(path, inner)
    return f"line {steps.gi_frame.f_lineno}"


def _place(path: Path, error: Exception) -> tuple[Path, str]:
    """File and line to blame: the innermost line of the laboratory's own that led to the error.

    What the procedure imports from beside it is its own, too; installed packages are not, nor is this program.
    """
    if isinstance(error, SyntaxError) and error.filename and error.lineno:
        return Path(error.filename), f"line {error.lineno}"
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if frame.lineno and _is_own(Path(frame.filename))]
    if not own:
        return path, "procedure"
    file = Path(own[-1].filename)
    return path if file == path.resolve() else file, f"line {own[-1].lineno}"


def _is_own(file: Path) -> bool:
    return file.is_file() and not any(file.resolve().is_relative_to(folder) for folder in INSTALLED)
