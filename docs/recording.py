"""The recorded session of the site: commands in a terminal, as they really ran, as one moving picture.

    make outputs                             docs/pictures/session.svg among others
    python docs/recording.py                 the same alone, some two minutes

Each command runs in a pseudo-terminal of COLUMNS × ROWS. The screen is looked at FRAMES times a second; each row
becomes a text that appears and disappears by CSS when it did so on the screen: no script is needed. Waiting is
shortened to MOST_WAIT: nobody wants to watch a computer compute. Where motion is not wanted (print, reduced motion) the
last screen is shown.
"""

import fcntl
import os
import pty
import select
import struct
import subprocess
import sys
import tempfile
import termios
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from html import escape
from itertools import groupby
from pathlib import Path
from time import monotonic

import pyte

sys.path.insert(0, str(Path(__file__).parent))
from page_pictures import WINDOW, draw

COMMANDS = (
    "fidim dry-run --seed 4 --equilibria 6 --validate 3 --hide swivel-friction:c=0.01 --out lab",
    "fidim explain lab --report why.html",
)
COLUMNS, ROWS = 110, 32
LINE, CHARACTER, MARGIN = 17.0, 8.4, 14.0
"""px"""
FRAMES = 4
"""a second"""
MOST_WAIT = 1.0
"""s"""
TYPING = 0.035
"""s for each character of a command"""
READING = 5.0
"""s before the next command is typed"""
GROUND, INK = "#16181d", "#d8dbe2"
COLORS = {
    "black": "#5c6370", "red": "#e06c75", "green": "#98c379", "brown": "#e5c07b",
    "blue": "#61afef", "magenta": "#c678dd", "cyan": "#56b6c2", "white": INK,
}  # fmt: skip

Row = tuple[tuple[int, str, str, bool], ...]
"""pieces of one style: first column, text, colour, bold"""


@dataclass(frozen=True)
class Shown:
    """What one row of the screen showed, s."""

    row: int
    pieces: Row
    begin: float
    end: float | None
    """None: to the end"""


def record(commands: Sequence[str], folder: Path) -> list[Shown]:
    """All that the screen showed while these commands ran one after the other. Raises SystemExit where one fails."""
    screen = pyte.Screen(COLUMNS, ROWS)
    stream = pyte.ByteStream(screen)
    at, now = 0.5, {}
    shown: list[Shown] = []

    def look() -> None:
        for k in range(ROWS):
            row = _row(screen, k)
            if k in now and now[k][0] == row:
                continue
            if k in now:
                shown.append(Shown(k, *now.pop(k), at))
            if row:
                now[k] = (row, at)

    for command in commands:
        at += len(command) * TYPING
        stream.feed(f"\x1b[1;32m$\x1b[0;1m {command}\x1b[0m\r\n".encode())
        look()
        before = monotonic()
        for piece in _printed(command, folder):
            stream.feed(piece)
            if monotonic() - before > 1 / FRAMES:
                at += min(monotonic() - before, MOST_WAIT)
                before = monotonic()
                look()
        at += 1 / FRAMES
        look()
        at += READING
    return shown + [Shown(k, *row, None) for k, row in now.items()]


def _printed(command: str, folder: Path) -> Iterator[bytes]:
    """What a command writes to its terminal; nothing at least FRAMES times a second."""
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", ROWS, COLUMNS, 0, 0))
    program, *arguments = command.split()
    child = subprocess.Popen(
        [str(Path(sys.executable).parent / program), *arguments],
        cwd=folder, stdin=subprocess.DEVNULL, stdout=theirs, stderr=theirs,
        env={**os.environ, "TERM": "linux", "COLORTERM": ""},
    )  # fmt: skip
    os.close(theirs)
    with os.fdopen(ours, "rb", buffering=0) as terminal:
        while True:
            if not select.select([terminal], [], [], 1 / FRAMES)[0]:
                yield b""
                continue
            try:
                read = terminal.read(65536)
            except OSError:  # its child has ended
                break
            if not read:
                break
            yield read
    if child.wait() > 1:  # 1 is an answer, too: a model that lacks something
        raise SystemExit(f"{command}: exit code {child.returncode}")


def _row(screen: pyte.Screen, k: int) -> Row:
    cells = [screen.buffer[k][column] for column in range(COLUMNS)]
    pieces: list[tuple[int, str, str, bool]] = []
    column = 0
    for (color, bold), group in groupby(cells, key=lambda cell: (cell.fg, cell.bold)):
        text = "".join(cell.data for cell in group)
        if text.strip():
            pieces.append((column, text.rstrip(), color, bold))
        column += len(text)
    return tuple(pieces)


def picture(shown: Sequence[Shown]) -> str:
    """The session as SVG."""
    width, height = COLUMNS * CHARACTER + 2 * MARGIN, ROWS * LINE + 2 * MARGIN
    still = ".a{animation:none}.e{display:none}"
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" role="img">',
            "<title>A session in a terminal: a dry run with friction hidden in it, and its explanation</title>",
            "<style>",
            f"text{{font:14px 'DejaVu Sans Mono',Menlo,Consolas,monospace;fill:{INK};white-space:pre}}",
            ".b{font-weight:bold}.a{animation:in .01s both}.e{animation:in .01s both,out .01s forwards}",
            "@keyframes in{from{visibility:hidden}to{visibility:visible}}@keyframes out{to{visibility:hidden}}",
            f"@media print{{{still}}}@media(prefers-reduced-motion:reduce){{{still}}}",
            "</style>",
            f'<rect width="100%" height="100%" rx="8" fill="{GROUND}"/>',
            f'<g transform="translate({MARGIN} {MARGIN})">',
            *(_drawn(one) for one in sorted(shown, key=lambda one: (one.begin, one.row))),
            "</g></svg>",
        ]
    )


def _drawn(one: Shown) -> str:
    delays = f"{one.begin:.2f}s" + ("" if one.end is None else f",{one.end:.2f}s")
    kind = "a" if one.end is None else "e"
    spans = "".join(_span(*piece) for piece in one.pieces)
    return f'<text class="{kind}" y="{(one.row + 0.8) * LINE:.1f}" style="animation-delay:{delays}">{spans}</text>'


def _span(column: int, text: str, color: str, bold: bool) -> str:
    """A piece of one style, as wide as its characters, whatever the font."""
    fill = "" if color == "default" else f' fill="{COLORS.get(color, f"#{color}")}"'
    heavy = ' class="b"' if bold else ""
    place = f'x="{column * CHARACTER:.1f}" textLength="{len(text) * CHARACTER:.1f}"'
    return f"<tspan {place}{fill}{heavy}>{escape(text)}</tspan>"


def main() -> None:
    """Run the commands and write the picture."""
    out = Path(__file__).parent / "pictures" / "session.svg"
    with tempfile.TemporaryDirectory() as folder:
        out.write_text(picture(record(COMMANDS, Path(folder))) + "\n", encoding="utf-8")
        draw(Path(folder) / "why.html", "explain", 1000, 3100)
        draw(Path(folder) / "lab" / "report.html", "report-window", 1100, 1230, WINDOW)


if __name__ == "__main__":
    main()
