"""Where output goes: results to standard output, progress and warnings to standard error."""

import sys
from collections.abc import Iterable

from rich.console import Console

from fidim_lab.say import printable

out = Console(highlight=False, soft_wrap=not sys.stdout.isatty(), width=None if sys.stdout.isatty() else 100)
err = Console(stderr=True, highlight=False, soft_wrap=not sys.stderr.isatty())


def warn(messages: Iterable[str]) -> None:
    """Print warnings, each on its own line, to standard error."""
    for message in messages:
        err.print(f"warning: {printable(message)}", style="yellow", markup=False)
