"""Files and folders that commands write: whether they can be written is known before anything is computed or moved.

An option of type `OUT_FILE`, `OUT_FOLDER`, … is checked by `Writing`, the class of the commands. What the disk refuses
later, however it was written, is said in the same words.
"""

import errno
import os
import stat
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click

from fidim_lab.errors import FidimError, HardwareError, SetupError

HINT = "Choose a folder that exists and is yours."
NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EROFS)
"""a disk that takes nothing more: whatever was being written, it is no bug"""


class Output(click.Path):
    """A path that the command writes."""

    def __init__(self, *, folder: bool = False, makes: bool = False, dir_okay: bool = True) -> None:
        """folder: no file may be there. makes: folders above it that are not there are made."""
        super().__init__(path_type=Path, dir_okay=dir_okay)
        self.folder, self.makes = folder, makes


OUT_FILE = Output(dir_okay=False)
"""in a folder that is there, or in one that the same command makes"""
OUT_FILE_DEEP = Output(dir_okay=False, makes=True)
OUT_FOLDER = Output(folder=True, makes=True)
OUT_EITHER = Output(makes=True)


class Writing(click.Command):
    """A command that refuses to begin what it could not write down."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """As click does it; for a word too many it tells which options take a file. Raises UsageError."""
        ctx.allow_extra_args = True
        left = super().parse_args(ctx, args)
        if left and not ctx.resilient_parsing:
            options = [one for one in self.params if isinstance(one, click.Option) and isinstance(one.type, click.Path)]
            names = ", ".join(one.opts[0] for one in options)
            which = f" Give files and folders with {names}." if names else ""
            raise click.UsageError(f"“{' '.join(left)}” is not expected here.{which}", ctx)
        return left

    def invoke(self, ctx: click.Context) -> Any:
        """As click does it. Raises SetupError for an output that cannot be written, HardwareError for a full disk."""
        outputs = list(_outputs(ctx))
        made = [path for _, path, kind in outputs if kind.folder]
        for option, path, kind in outputs:
            _require_writable(option, path, kind, made)
        try:
            return super().invoke(ctx)
        except OSError as error:
            said = _in_words(error, [(option, path) for option, path, _ in outputs])
            if said is None:
                raise
            raise said from error


def _outputs(ctx: click.Context) -> Iterator[tuple[str, Path, Output]]:
    for parameter in ctx.command.params:
        path = ctx.params.get(parameter.name or "")
        if isinstance(parameter.type, Output) and isinstance(path, Path):
            yield parameter.opts[0], path, parameter.type


def _require_writable(option: str, path: Path, kind: Output, made: list[Path]) -> None:
    above = {folder.absolute() for folder in made} & set(path.absolute().parents)
    try:
        if above and not kind.makes and not path.parent.exists():
            return  # in a folder that the command makes, which is checked itself
        mode = path.stat().st_mode if path.exists() else None
        if kind.folder and mode is not None and not stat.S_ISDIR(mode):
            what = f"{option} {path} exists already and is a file; it was not changed."
            raise SetupError(what, hint=f"Choose another {option}.")
        _try(path, mode, makes=kind.makes)
    except OSError as error:
        raise SetupError(_cannot(option, path, error), hint=HINT) from error


def _try(path: Path, mode: int | None, *, makes: bool) -> None:
    """Raise OSError where nothing can be written there. Permissions do not tell: /proc says yes to an administrator."""
    if mode is not None and not os.access(path, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    if mode is not None and not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        return  # a pipe or a device: nothing is made beside it
    folder = path if mode is not None and stat.S_ISDIR(mode) else path.parent
    while makes and not folder.exists():
        folder = folder.parent
    with tempfile.TemporaryFile(dir=folder):
        pass


def _in_words(error: OSError, outputs: list[tuple[str, Path]]) -> FidimError | None:
    """What it means where it is about an output, or about the disk; None for any other."""
    failed = None if error.filename is None else Path(str(error.filename))
    whose = next(((option, path) for option, path in outputs if failed is not None and _belongs(failed, path)), None)
    if error.errno in NO_ROOM:
        option, path = whose or ("", failed or "What the command writes")
        return HardwareError(_cannot(option, path, error), hint="Free some disk space, and repeat the command.")
    return None if whose is None else SetupError(_cannot(*whose, error), hint=HINT)


def _belongs(failed: Path, output: Path) -> bool:
    """The output, something in it, or the unfinished file beside it."""
    beside = failed.parent == output.parent and output.name in failed.name
    return failed == output or beside or output in failed.parents or failed in output.parents


def _cannot(option: str, path: Path | str, error: OSError) -> str:
    return f"{option} {path}: cannot be written: {error.strerror or error}.".lstrip()
