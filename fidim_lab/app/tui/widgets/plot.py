"""Curves of braille dots: two columns and four rows of them in each character, no library needed."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from fidim_lab.app.tui.paint import Line, Span, Style

DOTS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
"""bits of U+2800, by row and column"""


@dataclass(frozen=True, eq=False)
class Curve:
    """Points of one curve; a value that is None or not finite is a gap."""

    x: Sequence[float]
    y: Sequence[float | None]
    style: Style = "measured"


def canvas(
    curves: Sequence[Curve], x: tuple[float, float], y: tuple[float, float], width: int, height: int
) -> list[Line]:
    """Curves between limits of x and y, `width` × `height` characters; where two meet, the last gives the colour."""
    bits = [[0] * width for _ in range(height)]
    styles: list[list[Style]] = [[""] * width for _ in range(height)]
    for curve in curves:
        for column, row in _dots(curve, x, y, 2 * width, 4 * height):
            bits[row // 4][column // 2] |= DOTS[row % 4][column % 2]
            styles[row // 4][column // 2] = curve.style
    return [_line(b, s) for b, s in zip(bits, styles, strict=True)]


def limits(values: Sequence[float | None], least: float) -> tuple[float, float]:
    """The range of what is finite, with a margin, and not less than `least` wide."""
    found = [v for v in values if v is not None and math.isfinite(v)]
    if not found:
        return -least / 2, least / 2
    low, high = min(found), max(found)
    middle, half = (low + high) / 2, max(1.1 * (high - low), least) / 2
    return middle - half, middle + half


def _dots(
    curve: Curve, x: tuple[float, float], y: tuple[float, float], columns: int, rows: int
) -> list[tuple[int, int]]:
    """For each column of dots the rows from the lowest to the highest value in it: nothing between samples is lost."""
    ends: dict[int, tuple[int, int]] = {}
    for px, py in zip(curve.x, curve.y, strict=False):
        if py is None or not math.isfinite(py) or not x[0] <= px <= x[1]:
            continue
        column = min(int((px - x[0]) / (x[1] - x[0]) * columns), columns - 1)
        row = min(max(int((y[1] - py) / (y[1] - y[0]) * rows), 0), rows - 1)
        low, high = ends.get(column, (row, row))
        ends[column] = min(low, row), max(high, row)
    return [(column, row) for column, (low, high) in ends.items() for row in range(low, high + 1)]


def _line(bits: Sequence[int], styles: Sequence[Style]) -> Line:
    spans: list[Span] = []
    for value, style in zip(bits, styles, strict=True):
        text = chr(0x2800 + value)
        if spans and spans[-1].style == style:
            spans[-1] = Span(spans[-1].text + text, style)
        else:
            spans.append(Span(text, style))
    return tuple(spans)
