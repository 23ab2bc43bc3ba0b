"""`fidim ui`: attach the terminal UI to a service. The service owns the robot; this only looks, and asks."""

import os
import sys
import time
import traceback
from dataclasses import dataclass
from pathlib import Path

from drivers.clock import LoopClock
from fidim_lab.app.tui.app import FidimUi
from fidim_lab.app.tui.link import Finder, Link
from fidim_lab.data.rigs.rig_file import read_rig
from fidim_lab.errors import OurBugError, SetupError

LASTS = 10.0
"""s after which a screen that fails was a working one"""
FAILURES = 3
"""screens in a row that fail sooner: the next would, too"""
NO_KEY = "No key of this screen stops the robot now. Use fidim stop in any terminal, or the hardware stop."


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
        raise SetupError(f"{folder} is not a folder; a run folder is expected, or --rig RIG.toml.")
    return Finder(rig=None if rig is None else read_rig(rig), folder=folder)


def need_terminal(instead: str) -> None:
    """Raise SetupError where nobody could see the UI or press a key; a browser's driver has pipes of its own.

    instead: the command that needs no terminal.
    """
    if "TEXTUAL_DRIVER" in os.environ or (sys.stdin.isatty() and sys.stderr.isatty()):  # it draws on stderr
        return
    raise SetupError("The UI needs a terminal, but its input or output is not one.", hint=f"Use {instead} here.")


def run_ui(finder: Finder, folder: Path | None, *, light: bool = False) -> None:
    """The UI in this terminal, until q. A screen that fails begins anew: the key that stops is not lost.

    Raises OurBugError where it fails again and again.
    """
    clock, says, failures = LoopClock(), "", 0
    while True:
        app = FidimUi(Link(finder, clock), clock, folder, light=light, says=says)
        begun = time.monotonic()
        app.run()
        if app.fault is None:
            return
        failures = failures + 1 if time.monotonic() - begun < LASTS else 1
        says = f"✗ The screen has failed and was restarted ({_where(app.fault)})."
        if failures >= FAILURES:
            raise OurBugError(f"The screen fails repeatedly: {_where(app.fault)}.", hint=NO_KEY) from app.fault


def _where(fault: BaseException) -> str:
    """What went wrong and the place in our files."""
    frames = traceback.extract_tb(fault.__traceback__)
    place = f" at {Path(frames[-1].filename).name}:{frames[-1].lineno}" if frames else ""
    return f"{type(fault).__name__}: {fault}{place}"
