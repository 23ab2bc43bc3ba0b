"""The `fidim` group itself, and what all its commands share."""

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from fidim_lab.app.cli.outputs import Writing

FOLDER = click.Path(path_type=Path)
FILE = click.Path(path_type=Path, dir_okay=False)


class _RobotFile(click.Path):
    """A robot file, or the name of a built-in robot, as in rig files."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """As click does it, once a name has become a path."""
        from fidim_lab.data.robot_file import robot_path

        return super().convert(robot_path(str(value)), param, ctx)


class Number(click.FloatRange):
    """A finite number in a range: click takes nan for inside of any, and inf for above any."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """As click does it."""
        number = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"{value} is not a finite number.", param, ctx)
        return number


ROBOT = _RobotFile(path_type=Path, dir_okay=False)


def example(text: str) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Close a command's help with an example that can be typed."""

    def add(command: Callable[..., Any]) -> Callable[..., Any]:
        command.__doc__ = f"{command.__doc__}\n\n    \b\n    Example:\n      {text}\n    "
        return command

    return add


def only_with(flag: str, *names: str) -> None:
    """Refuse options that were given but would be ignored without this flag, which is not. Raises UsageError."""
    for option in given(names):
        raise click.UsageError(f"{option} needs {flag}.")


def not_with(flag: str, *names: str) -> None:
    """Refuse options that were given but would be ignored with this flag, which is there. Raises UsageError."""
    for option in given(names):
        raise click.UsageError(f"{option} cannot be used with {flag}.")


def nothing_but(flag: str, *names: str) -> None:
    """Refuse what was given but would be ignored with this flag, which is there. Raises UsageError."""
    options = _options()
    ignored = given([name for name in options if name not in names])
    if ignored:
        allowed = ", ".join(options[name] for name in names if options[name] != flag)
        raise click.UsageError(f"{', '.join(ignored)} cannot be used with {flag}. Allowed with it: {allowed}.")


def given(names: Sequence[str]) -> list[str]:
    """Those of these options that stand on the command line."""
    source, options = click.get_current_context().get_parameter_source, _options()
    return [options[name] for name in options if name in names and source(name) is ParameterSource.COMMANDLINE]


def _options() -> dict[str, str]:
    """Those of the present command, by the names of its arguments."""
    return {parameter.name or "": parameter.opts[0] for parameter in click.get_current_context().command.params}


HEADINGS = {
    "session": "At a robot, or at simulated devices",
    "analysis": "Compute",
    "records": "Recordings and results",
}
"""module of this package → how `fidim --help` calls its commands"""
WIDEST = 200


class Sections(click.Group):
    """Commands listed under the heading of their module."""

    command_class = Writing

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """As click does it, in sections."""
        for module, heading in HEADINGS.items():
            found = [(name, one) for name, one in sorted(self.commands.items()) if _module(one) == module]
            with formatter.section(heading):
                formatter.write_dl([(name, one.get_short_help_str(WIDEST)) for name, one in found])


def _module(command: click.Command) -> str:
    return "" if command.callback is None else command.callback.__module__.rpartition(".")[2]


@click.group(cls=Sections, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(package_name="fidim-lab", prog_name="fidim")
def fidim() -> None:
    """Free-motion experiments on cable-suspended robots: acquire, identify, explain.

    Exit codes: 0 done; 1 done, but the answer is a refusal or a failed check; 2 wrong use or bad input; 3
    stopped by hardware or a guard; 130 interrupted. Every command has --debug, which shows where an error came from.
    """
