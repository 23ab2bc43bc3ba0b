"""Arguments in, exit code out (spec/formats.md): errors become sentences, signals interruptions."""

import faulthandler
import os
import signal
import sys
import traceback
from collections.abc import Sequence
from types import FrameType

import click

from fidim_lab.app.cli.root import fidim
from fidim_lab.errors import FidimError, SetupError
from fidim_lab.say import printable

EXIT_WRONG_USE = 2
EXIT_OUR_BUG = 3
EXIT_INTERRUPTED = 130


def run(arguments: Sequence[str]) -> int:
    """Run the command with these arguments and return its exit code; no traceback reaches a user without --debug."""
    debug = "--debug" in arguments
    try:
        fidim.main([a for a in arguments if a != "--debug"], prog_name="fidim", standalone_mode=False)
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else 0
    except (KeyboardInterrupt, click.Abort):
        click.echo("interrupted", err=True)
        return EXIT_INTERRUPTED
    except click.ClickException as error:
        error.show()
        return EXIT_WRONG_USE
    except FidimError as error:
        _explain(error, debug)
        return error.exit_code
    except BrokenPipeError:
        return 0
    except OSError as error:
        if error.filename is None or debug:
            return _our_bug(error, debug)
        place = SetupError(f"{error.filename!s:.160}: {error.strerror or error}")
        _explain(place, debug)
        return place.exit_code
    except Exception as error:
        return _our_bug(error, debug)
    return 0


def _our_bug(error: Exception, debug: bool) -> int:
    _explain(error, debug)
    click.echo("This is a bug of fidim-lab, not yours; --debug shows where it happened.", err=True)
    return EXIT_OUR_BUG


def _explain(error: Exception, debug: bool) -> None:
    if debug:
        traceback.print_exception(error)
    sentence = str(error) if isinstance(error, FidimError) else f"{type(error).__name__}: {error}"
    click.echo(f"fidim: {printable(sentence)}", err=True)


def _terminate(number: int, frame: FrameType | None) -> None:
    """A polite kill is an interruption: the robot is held and the folder kept, as with Ctrl-C."""
    raise KeyboardInterrupt


def main() -> None:
    """Entry point of the `fidim` command."""
    # All our matrices are small: BLAS threads only wait for each other. To be said before numpy is imported.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    signal.signal(signal.SIGTERM, _terminate)
    if sys.__stderr__ is not None:
        faulthandler.enable(sys.__stderr__)  # a crash of the interpreter says where: nothing else could
    sys.exit(run(sys.argv[1:]))
