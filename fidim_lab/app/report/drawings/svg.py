"""How pictures become inline SVG: one style, the same bytes for the same data, no link to anywhere.

`sheet` opens a figure, `to_svg` ends it, `styled` wraps what draws in between; `distinct` lets pictures share a page.
Colours are those of Okabe and Ito, which colour-blind people can tell apart; lines differ in style too.
"""

import io
import re
import warnings
from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec, TypeVar

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fidim_lab.app.report.drawings.tight import classed, shortened, ungrouped
from fidim_lab.arrays import Series

P = ParamSpec("P")
T = TypeVar("T")

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
STYLES = ("-", "--", "-.", ":", (0, (5, 1)), (0, (1, 1)))
POINTS = 400
"""points drawn for each line: as many as the eye sees, few enough for a small file"""
FEWEST = 50
"""… whatever the number of windows"""
ROOM, BARE, EACH = 2.7e6, 34e3, 200.0
"""bytes of a page of at most 3 MB for its windows; of a window's pictures without lines; of one point in each line"""

_STYLE: dict[Any, Any] = {
    "svg.hashsalt": "fidim",
    "svg.fonttype": "none",
    "text.parse_math": False,  # a window may be called a$b$c
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "path.simplify": True,
    "path.simplify_threshold": 0.5,
    "legend.frameon": False,
}
_METADATA: dict[str, Any] = {"Date": None, "Creator": None, "Format": None, "Type": None}


def styled(draw: Callable[P, T]) -> Callable[P, T]:
    """Run a drawing function under the report's style, whatever the user's matplotlibrc says."""

    @wraps(draw)
    def drawn(*args: P.args, **kwargs: P.kwargs) -> T:
        with mpl.rc_context(), warnings.catch_warnings():
            mpl.rcdefaults()
            mpl.rcParams.update(_STYLE)
            # The browser has the glyphs that matplotlib's own font lacks: text stays text.
            warnings.filterwarnings("ignore", message="Glyph .* missing")
            return draw(*args, **kwargs)

    return drawn


def sheet(width: float, height: float, rows: int = 1, left: float = 0.72) -> tuple[Figure, list[Axes]]:
    """A figure (inches) with axes one above the other over a common abscissa, `left` inches for their labels.

    Margins are fixed: that is ten times quicker than measuring every label.
    """
    figure = Figure(figsize=(width, height))
    axes = figure.subplots(rows, 1, sharex=True, squeeze=False)
    figure.subplots_adjust(
        left=left / width, right=1 - 0.14 / width, bottom=0.45 / height, top=1 - 0.24 / height, hspace=0.16
    )
    return figure, list(axes[:, 0])


def thin(t: Series, values: Series, most: int = POINTS) -> tuple[Series, Series]:
    """At most so many samples of a line: the smallest and largest of each stretch, so that no peak is lost.

    A gap (NaN) stays a gap where a whole stretch is missing, or where it is one of the samples kept.
    """
    if len(t) <= most:
        return t, values
    size = -(-2 * len(t) // most)
    count = -(-len(t) // size)
    padded = np.full(count * size, np.nan)
    padded[: len(t)] = values
    stretches = padded.reshape(count, size)
    low = np.argmin(np.where(np.isnan(stretches), np.inf, stretches), axis=1)
    high = np.argmax(np.where(np.isnan(stretches), -np.inf, stretches), axis=1)
    first = size * np.arange(count)
    picked = np.unique(np.concatenate([first + low, first + high]))
    picked = picked[picked < len(t)]
    return t[picked], values[picked]


def points_for(windows: int, most: int = POINTS) -> int:
    """How many of `most` points a line may have on a page of so many windows, so that the page stays light."""
    room = (ROOM / max(windows, 1) - BARE) / EACH
    return max(min(FEWEST, most), int(most * min(room / POINTS, 1.0)))


def to_svg(figure: Figure) -> str:
    """The figure as SVG for a page: a `viewBox` instead of a size, hundredths of a point, no name-space addresses."""
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata=_METADATA)
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r' xmlns(:xlink)?="[^"]*"| version="[^"]*"| (width|height)="[\d.]+pt"', "", text, count=5)
    text = text.replace("xlink:href", "href")
    text = re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)
    text = re.sub(r' d="([^"]*)"', lambda found: f' d="{_rounded(found[1])}"', text)
    text = re.sub(r' (x|y|transform)="([^"]*)"', lambda found: f' {found[1]}="{_rounded(found[2])}"', text)
    return shortened(re.sub(r"\s*\n\s*", "\n", text).strip())


def distinct(svg: str, prefix: str) -> str:
    """The same picture with identifiers of its own; those that nothing refers to go."""
    used = set(re.findall(r'(?:url\(|href=")#([^)"]+)', svg))

    def renamed(found: re.Match[str]) -> str:
        return f' id="{prefix}-{found[1]}"' if found[1] in used else ""

    svg = re.sub(r' id="([^"]*)"', renamed, svg)
    return classed(ungrouped(re.sub(r'(url\(|href=")#', rf"\g<1>#{prefix}-", svg)))


def _rounded(numbers: str) -> str:
    tight = re.sub(r"\s*\n\s*", " ", numbers).strip()
    return re.sub(r"-?\d+\.\d+", lambda found: f"{float(found[0]):.2f}".rstrip("0").rstrip("."), tight)
