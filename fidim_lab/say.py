"""Words for people: progress of work that takes a while, and text that somebody else wrote.

Work says what it does (`Say`), and whoever started it decides where that goes; what came from another process, device
or file passes `printable` before it reaches a terminal.
"""

from collections.abc import Callable, Iterable

Say = Callable[[str], None]
"""takes a line for people"""
LONGEST = 2000
"""characters of one text: a screen full; the errors of eight drives together have 900"""


def printable(text: str, longest: int = LONGEST) -> str:
    r"""One line that a terminal only shows, of at most `longest` characters (at least 1); printable text is unchanged.

    Line ends, tabs and special spaces become spaces. Escape, C1 and other control characters, direction marks, zero
    widths, private and unassigned characters are written as their codes (`\x1b`), so that nothing is hidden. What is
    too long ends in an ellipsis.
    """
    if len(text) <= longest and text.isprintable():
        return text
    shown = "".join(map(_shown, text[: longest + 1]))
    return shown if len(shown) <= longest else f"{shown[: longest - 1]}…"


def counted(number: int, noun: str) -> str:
    """A number with its noun: 1 window, 2 windows."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def each_once(said: Iterable[tuple[str, str]]) -> dict[str, str]:
    """What is said of several things, by its text; the names of those of which the same is said stand together."""
    names: dict[str, list[str]] = {}
    for name, text in said:
        names.setdefault(text, []).append(name)
    return {text: ", ".join(of) for text, of in names.items()}


def _shown(character: str) -> str:
    if character.isprintable():
        return character
    return " " if character.isspace() else character.encode("unicode_escape").decode("ascii")
