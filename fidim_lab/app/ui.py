"""`fidim ui`: attach the terminal UI to a service. The service owns the robot; this only looks, and asks."""

import os
import sys
from dataclasses import dataclass
from pathlib import Path

from drivers.clock import LoopClock
from fidim_lab.app.tui.app import FidimUi
from fidim_lab.app.tui.find import Finder
from fidim_lab.app.tui.link import Link
from fidim_lab.data.rig_file import read_rig
from fidim_lab.errors import SetupError


@dataclass(frozen=True)
class UiOptions:
    """As on the command line."""

    folder: Path | None
    rig: Path | None
    light: bool
    web: bool
    port: int


def ui_command(options: UiOptions) -> int:
    """Attach until the person leaves; returns 0.

    Raises SetupError for a folder that is none and where there is no terminal, FileError for a rig.
    """
    finder = finder_for(options.folder, options.rig)
    if options.web:
        from fidim_lab.app.tui.web import serve

        serve(options.folder, options.rig, options.port, light=options.light)
        return 0
    need_terminal("fidim ui --web")
    run_ui(finder, options.folder, light=options.light)
    return 0


def finder_for(folder: Path | None, rig: Path | None) -> Finder:
    """What to attach to. Raises SetupError for a folder that is none or both given, FileError for a wrong rig file."""
    if folder is not None and rig is not None:
        raise SetupError("Give a run folder or --rig, not both.")
    if folder is not None and not folder.is_dir():
        raise SetupError(f"{folder}: is no folder; a run folder is expected, or --rig RIG.toml.")
    return Finder(rig=None if rig is None else read_rig(rig), folder=folder)


def need_terminal(instead: str) -> None:
    """Raise SetupError where nobody could see the UI or press a key; a browser's driver has pipes of its own.

    instead: the command that needs no terminal.
    """
    if "TEXTUAL_DRIVER" in os.environ or (sys.stdin.isatty() and sys.stderr.isatty()):  # it draws on stderr
        return
    raise SetupError("The UI needs a terminal, and its input or its output is none.", hint=f"Use {instead} here.")


def run_ui(finder: Finder, folder: Path | None, *, light: bool = False) -> None:
    """The UI in this terminal, until q."""
    clock = LoopClock()
    FidimUi(Link(finder, clock), clock, folder, light=light).run()
