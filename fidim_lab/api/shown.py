"""How values of the interface show themselves: as the commands print, without colours, and as tables in notebooks."""

import io

from rich.console import Console, RenderableType

WIDE = 160
"""columns of a printed answer: no table of ours is wider"""


def as_text(renderable: RenderableType) -> str:
    """What a command prints, as a text without trailing blanks."""
    buffer = io.StringIO()
    Console(file=buffer, width=WIDE, highlight=False, color_system=None).print(renderable)
    return "\n".join(line.rstrip() for line in buffer.getvalue().splitlines())
