"""docs/commands.md, made from the commands themselves: `python -m docs.tools.commands > docs/commands.md`."""

import inspect
import sys

import click

from fidim_lab.app.cli import fidim
from fidim_lab.app.cli.root import HEADINGS

INTRODUCTION = """# Commands

Made from the commands by `python -m docs.tools.commands`; a test compares them. `fidim COMMAND --help` says the
same in a terminal.

Exit codes: 0 done; 1 done, but the answer is a refusal or a failed check; 2 wrong use or bad input; 3 stopped by
hardware or a guard; 130 interrupted. Every command has `--debug`, which shows where an error came from. Output that
does not go to a terminal is plain text, without colours or moving progress. `--json FILE` writes the answer as one
object that names its format.

## Completion

The Tab key completes commands, options, choices, and after `--hide` the effects and their keys. It needs one line in
the shell's start file:

| shell | file | line |
|---|---|---|
| bash | `~/.bashrc` | `eval "$(_FIDIM_COMPLETE=bash_source fidim)"` |
| zsh | `~/.zshrc` | `eval "$(_FIDIM_COMPLETE=zsh_source fidim)"` |
| fish | `~/.config/fish/completions/fidim.fish` | `_FIDIM_COMPLETE=fish_source fidim \\| source` |
"""


def commands_page() -> str:
    """The whole page, in the order of `fidim --help`."""
    parts = [INTRODUCTION]
    for module, heading in HEADINGS.items():
        parts.append(f"## {heading}\n")
        for name, command in sorted(fidim.commands.items()):
            callback = command.callback
            if callback is not None and callback.__module__.rpartition(".")[2] == module:
                parts += _sections(name, command)
    return "\n".join(parts)


def _sections(name: str, command: click.Command) -> list[str]:
    inner = command.commands.items() if isinstance(command, click.Group) else ()
    return [_section(name, command), *(_section(f"{name} {below}", one) for below, one in sorted(inner))]


def _section(name: str, command: click.Command) -> str:
    text, _, example = inspect.cleandoc(command.help or "").partition("\b\nExample:\n")
    lines = [f"### `fidim {name}`\n", text.strip() + "\n"]
    if example:
        lines += ["```", *(line.strip() for line in example.strip().splitlines()), "```\n"]
    context = click.Context(command, info_name=name)
    rows = [_row(one, context) for one in command.params if not getattr(one, "hidden", False)]
    if rows:
        lines += ["| option | | default |", "|---|---|---|", *rows, ""]
    return "\n".join(lines)


def _row(parameter: click.Parameter, context: click.Context) -> str:
    kind = _kind(parameter, context)
    if isinstance(parameter, click.Argument):
        return _cells(f"`{kind}`", "", "")
    names = ", ".join((*parameter.opts, *parameter.secondary_opts))
    flag = isinstance(parameter, click.Option) and parameter.is_flag
    says = (parameter.help or "") if isinstance(parameter, click.Option) else ""
    given = parameter.default if isinstance(parameter, click.Option) and parameter.show_default else None
    needed = "must be given" if parameter.required else ""
    shown = "" if flag or not isinstance(given, str | int | float) else f"`{given}`"
    return _cells(f"`{names if flag else f'{names} {kind}'}`", says, needed or shown)


def _kind(parameter: click.Parameter, context: click.Context) -> str:
    """What is to be given, a number with its range."""
    wanted = parameter.type
    if not isinstance(wanted, click.IntRange | click.FloatRange) or getattr(parameter, "metavar", None):
        return parameter.make_metavar(context)
    low = "" if wanted.min is None else f"{wanted.min:g}"
    high = "" if wanted.max is None else f"{wanted.max:g}"
    return f"{low}…{high}" if low and high else f"above {low}" if wanted.min_open else f"at least {low}"


def _cells(*cells: str) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


if __name__ == "__main__":
    sys.stdout.write(commands_page())
