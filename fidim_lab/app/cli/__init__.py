"""The `fidim` command: options in, exit code out (spec/formats.md). What a command does is in a module of its own."""

from fidim_lab.app.cli import analysis, records, session
from fidim_lab.app.cli.root import fidim
from fidim_lab.app.cli.start import main, run

__all__ = ["analysis", "fidim", "main", "records", "run", "session"]
