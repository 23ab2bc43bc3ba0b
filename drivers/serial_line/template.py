"""The format of a measuring device's lines, as declared in the rig file: `"ST,{*},{1} kg"`. Pure.

Literal text stands for itself, a blank for any blanks, `{name}` for a number that is called so, `{*}` for anything.
A template, not a regular expression: whoever can read the device's manual can write it, and no line can stall it.
"""

import math
import re
from collections.abc import Mapping

from fidim_lab.errors import SetupError

ANYTHING = "*"
MOST_ANYTHING = 3
"""of `{*}` in a template: more could make matching slow"""
_NUMBER = r"[+-]?[ \t]{0,8}(?:\d{1,15}(?:\.\d{0,15})?|\.\d{1,15})(?:[eE][+-]?\d{1,3})?"
_PLACE = re.compile(r"\{([^{}]*)\}")


class LineTemplate:
    """The numbers of a line by their names."""

    def __init__(self, text: str) -> None:
        """Raises SetupError for a template without a number, with a name twice, or with braces that do not pair."""
        parts = _PLACE.split(text)
        names = parts[1::2]
        self.text = text
        self.names = tuple(name for name in names if name != ANYTHING)
        """of the numbers, in their order in a line"""
        _check(text, parts[::2], names)
        pattern = "".join(_literal(part) if k % 2 == 0 else _place(part) for k, part in enumerate(parts))
        self._pattern = re.compile(rf"[ \t]*{pattern}[ \t]*")

    def read(self, line: str) -> Mapping[str, float] | None:
        """The numbers of a line, None where it does not look like the template or a number is not finite."""
        found = self._pattern.fullmatch(line)
        if found is None:
            return None
        values = [float(re.sub(r"[ \t]", "", group)) for group in found.groups()]
        return dict(zip(self.names, values, strict=True)) if all(map(math.isfinite, values)) else None

    def write(self, values: Mapping[str, str], anything: str = "") -> str:
        """A line with these numbers, already as text: for simulated devices and tests."""
        return _PLACE.sub(lambda place: values.get(place[1], anything), self.text)


def _check(text: str, literals: list[str], names: list[str]) -> None:
    problem = ""
    if any(brace in literal for literal in literals for brace in "{}"):
        problem = "braces do not pair"
    elif not (named := [name for name in names if name != ANYTHING]):
        problem = "has no number; an example is {1}"
    elif "" in named:
        problem = "has a number without a name: {}"
    elif len(set(named)) < len(named):
        problem = "has a name twice"
    elif names.count(ANYTHING) > MOST_ANYTHING:
        problem = f"has more than {MOST_ANYTHING} of {{*}}"
    elif any(not literal for literal in literals[1:-1]):
        problem = "has two places with nothing between them"
    if problem:
        raise SetupError(f"pattern {text!r}: {problem}.")


def _literal(text: str) -> str:
    """A run of blanks stands for any blanks, or none at a line's end and beside a number."""
    return "".join(r"[ \t]*" if part.isspace() else re.escape(part) for part in re.split(r"([ \t]+)", text) if part)


def _place(name: str) -> str:
    return r".{0,80}?" if name == ANYTHING else f"({_NUMBER})"
