"""What the console prints of names that others chose: shown, never obeyed."""

import io

import pytest
from rich.table import Table

from fidim_lab.app.terminal.console import Plain

NAMES = (
    "x\x1b]0;OWNED\x07",
    "\x9b2J",
    "a\u202egnp.exe",
    "zero\u200bwidth",
    b"\xff\xfe".decode(errors="surrogateescape"),
)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("cell", [True, False])
def test_no_escape_and_no_direction_mark_is_printed(name: str, cell: bool) -> None:
    file = io.StringIO()
    console = Plain(file=file, width=200, force_terminal=False)
    table = Table("run")
    table.add_row(name)
    console.print(table if cell else f"Report  runs/{name}/report.html\nsecond line", markup=False)
    printed = file.getvalue()
    assert all(line.isprintable() for line in printed.splitlines())
    assert name.encode("unicode_escape").decode() in printed
    assert cell or "\nsecond line" in printed
