"""Where output goes: results to standard output, progress and warnings to standard error."""

import sys
from collections.abc import Iterable, Sequence
from typing import Any

import click
from rich.console import Console
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from fidim_lab.errors import RefusedError
from fidim_lab.say import printable


class Plain(Console):
    """A console on which names of files and folders, and texts of others, stay what they are: no escape reaches it."""

    def render_str(self, text: str, **options: Any) -> Text:
        """Of what is printed, and of each cell of a table."""
        lines = text.split("\n")
        return super().render_str("\n".join(printable(line, len(text) * WIDEST) for line in lines), **options)


WIDEST = len("\\U0001f600")
"""characters as which one is written that a terminal would obey"""
out = Plain(highlight=False, soft_wrap=not sys.stdout.isatty(), width=None if sys.stdout.isatty() else 100)
err = Plain(stderr=True, highlight=False, soft_wrap=not sys.stderr.isatty())


def warn(messages: Iterable[str]) -> None:
    """Print warnings, each on its own line, to standard error."""
    for message in messages:
        err.print(f"warning: {printable(message)}", style="yellow", markup=False)


def confirm(question: str, otherwise: str) -> None:
    """Ask a person. Raises RefusedError with what `otherwise` says for a no, and where the input ends unanswered."""
    try:
        if click.confirm(question, err=True):
            return
        hint = ""
    except click.Abort as end:
        if not isinstance(end.__context__, EOFError):
            raise
        click.echo(err=True)  # the question stands without an answer
        hint = "Standard input has ended, so nobody can answer: --yes confirms it."
    raise RefusedError(otherwise, hint=hint)


def table(title: str, names: Sequence[str], rows: Iterable[Sequence[str]], *, left: int = 1, **style: Any) -> Table:
    """A table of text cells, none of them markup: the first `left` columns hold words, the others figures.

    style: of rich's Table.
    """
    made = Table(title=escape(title) or None, **style)
    for index, name in enumerate(names):
        made.add_column(escape(name), justify="left" if index < left else "right")
    for row in rows:
        made.add_row(*map(escape, row))
    return made


def answer(head: str, parts: Iterable[tuple[str, str]]) -> list[Text]:
    """An answer's bold head, and its parts (title, text), each in a line of its own."""
    return [Text(head, style="bold"), *(Text(f"{title}: {said}") for title, said in parts)]
