"""Put into the README and docs what the commands really print: `make outputs`.

A block that follows `<!-- output of: COMMAND -->` is replaced by the command's standard output.
`tests/end_to_end/test_readme.py` compares the README's with a run of its own.
"""

import re
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from page_pictures import draw

ROOT = Path(__file__).parents[1]
BLOCK = re.compile(r"<!-- output of: (?P<command>fidim [^>]*?) -->\n```\n(?P<text>.*?)```", re.DOTALL)


def blocks(text: str) -> list[tuple[str, str]]:
    """(command, text) of each block in a page."""
    return [(match["command"], match["text"]) for match in BLOCK.finditer(text)]


def printed(command: str, shown_from: str = "run ", *, draws: bool = False) -> str:
    """What a command prints on standard output, from the first line that begins with `shown_from`.

    The command runs in an empty folder; draws: the first page of the README shows the report that it leaves there.
    Raises CalledProcessError where it fails.
    """
    fidim = Path(sys.executable).parent / "fidim"
    with tempfile.TemporaryDirectory() as empty:
        done = subprocess.run(
            [str(fidim), *shlex.split(command)[1:]], cwd=empty, capture_output=True, text=True, check=True
        )
        reports = sorted(Path(empty).rglob("report.html"))
        if draws and reports:
            draw(reports[0], "report", 1000, 1230)
    lines = done.stdout.splitlines(keepends=True)
    first = next((k for k, line in enumerate(lines) if line.startswith(shown_from)), 0)
    return "".join(lines[first:])


def main() -> None:
    """Renew all blocks of the README and of docs."""
    for page in (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))):
        text = page.read_text(encoding="utf-8")
        for command, old in blocks(text):
            head = f"<!-- output of: {command} -->\n```\n"
            new = printed(command, draws=page.name == "README.md")
            text = text.replace(f"{head}{old}```", f"{head}{new}```")
        page.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
