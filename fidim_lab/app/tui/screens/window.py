"""Window: x, y, z of the recording as it grows, the model's prediction over it, and what is left.

While a hand displaces the platform: wanted and present place, in large figures.
"""

import math
from collections.abc import Sequence

from fidim_lab.app.tui.foresight import Foreseen
from fidim_lab.app.tui.paint import Line, Span, block, left, line, milli
from fidim_lab.app.tui.screens.hand import hand_lines
from fidim_lab.app.tui.view import ScreenState, Trace
from fidim_lab.app.tui.widgets.plot import Curve, canvas, limits

LABEL = 13
LEAST = 0.002
"""m; a smaller range is not magnified: noise would look like motion"""
AXES = "xyz"


def window_lines(view: ScreenState, width: int, height: int, foreseen: Foreseen | None, doubt: str = "") -> list[Line]:
    """The whole screen in this many lines; doubt: why there is no prediction."""
    trace = view.trace
    if not view.recording and (figures := hand_lines(view, height)):
        return figures
    if len(trace.t) < 2:
        says = "Nothing has been recorded since this screen was opened. Curves appear while a window is recorded."
        return block(says, width, "dim")
    known = foreseen if foreseen is not None and foreseen.of == (trace.window, trace.attempt) else None
    rows = [_head(view, trace, known, doubt, width)]
    left_over = residuals(trace, known)
    curves = max((height - 2) // (4 if known else 3), 2)
    span = _span(trace, known)
    for axis in range(3):
        rows += _axis(trace, known, axis, span, width, curves)
    if known is not None:
        rows += _residual(trace, left_over, span, width, max(height - 2 - 3 * curves, 2))
    rows.append(line(Span(f"{'':{LABEL}}0 s{span[1] - span[0]:>{max(width - LABEL - 6, 1)}.1f} s", "dim")))
    return rows


def residuals(trace: Trace, foreseen: Foreseen | None) -> list[float | None]:
    """|recorded − predicted| of each sample, m; None where either is missing."""
    if foreseen is None:
        return [None] * len(trace.t)
    found: list[float | None] = []
    for t, measured in zip(trace.t, trace.positions, strict=True):
        model = foreseen.at(t)
        found.append(None if model is None or measured is None else math.dist(measured, model))
    return found


def _head(view: ScreenState, trace: Trace, known: Foreseen | None, doubt: str, width: int) -> Line:
    state = "● recording" if view.recording else "○ the last recording"
    begin = f"{trace.window} #{trace.attempt}  {trace.t[-1] - trace.t[0]:.1f} s  {state}  "
    if known is None:
        return line(Span(begin, "head"), Span(left(doubt, max(width - len(begin), 0)), "dim"))
    model = f"━ model: {known.body}, fitted to the first {known.fitted:.1f} s"
    return line(Span(begin, "head"), Span("━ recorded  ", "measured"), Span(model, "model"))


def _span(trace: Trace, known: Foreseen | None) -> tuple[float, float]:
    end = trace.t[-1] if known is None else max(trace.t[-1], min(known.t[-1], trace.t[-1] + 2.0))
    return trace.t[0], max(end, trace.t[0] + 1.0)


def _axis(
    trace: Trace, known: Foreseen | None, axis: int, span: tuple[float, float], width: int, rows: int
) -> list[Line]:
    measured = [None if p is None else p[axis] for p in trace.positions]
    y = limits(measured, LEAST)
    model = [] if known is None else [Curve(known.t, [p[axis] for p in known.positions], "model")]
    drawn = canvas([*model, Curve(trace.t, measured)], span, y, max(width - LABEL, 4), rows)
    return _labelled(drawn, f"{AXES[axis]} m", y, 3, 1.0)


def _residual(
    trace: Trace, values: Sequence[float | None], span: tuple[float, float], width: int, rows: int
) -> list[Line]:
    known = [v for v in values if v is not None]
    top = max([*known, 1e-4]) * 1.1
    drawn = canvas([Curve(trace.t, values, "warn")], span, (0.0, top), max(width - LABEL, 4), rows)
    rms = math.sqrt(sum(v * v for v in known) / len(known)) if known else None
    labelled = _labelled(drawn, "Δ mm", (0.0, top), 2, 1e3)
    says = f"rms {milli(rms, 2)}"
    if rows >= 3:
        labelled[1] = (Span(left(says, LABEL), "warn"), *labelled[1][1:])
    return labelled


def _labelled(drawn: list[Line], name: str, y: tuple[float, float], decimals: int, factor: float) -> list[Line]:
    """The highest value and the lowest beside the curve."""
    labels = [""] * len(drawn)
    labels[-1] = f"{factor * y[0]:.{decimals}f}"
    labels[0] = f"{name} {factor * y[1]:.{decimals}f}"
    return [(Span(f"{label:>{LABEL - 1}} ", "dim"), *row) for label, row in zip(labels, drawn, strict=True)]
