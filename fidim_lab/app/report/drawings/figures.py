"""Pictures of what was measured and found: a window's motion, tensions, parameters, cross-validation, the run.

Each returns SVG for a page (see `svg`); the same data give the same bytes.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.ticker import NullFormatter, StrMethodFormatter

from fidim_lab.app.report.drawings.drawing import Drawing
from fidim_lab.app.report.drawings.svg import COLOURS, POINTS, STYLES, sheet, styled, thin, to_svg
from fidim_lab.arrays import CableSeries, Positions, Series, Vector3
from fidim_lab.data.records import PARAMETER_NAMES
from fidim_lab.identification.results.result import IdentificationResult
from fidim_lab.units import millimetres

STRONG = 0.9
"""correlation from which two parameters are named as tied"""
DARK = 0.6
"""beyond, the cell is so dark that its number must be white"""

WIDTH = 6.4
"""inches of a picture"""


@dataclass(frozen=True, eq=False)
class Course:
    """Three coordinates over a time of their own."""

    t: Series
    """s"""
    values: Positions
    """m"""


@styled
def trajectory(
    recorded: Course,
    rest: Vector3 | None,
    model: Course | None,
    points: int = POINTS,
    removed: Sequence[tuple[float, float]] = (),
) -> str:
    """Draw the main marker against time, mm from rest (from its mean where that is unknown), the model over it.

    removed: begins and ends (s) of what is not used, shaded.
    """
    figure, axes = sheet(WIDTH, 5.6, rows=3)
    origin = _mean(recorded.values) if rest is None else rest
    for k, (axis, name) in enumerate(zip(axes, "xyz", strict=True)):
        _line(axis, recorded.t, millimetres_of(recorded.values[:, k] - origin[k]), 0, "recorded", points, width=1.6)
        if model is not None:
            _line(axis, model.t, millimetres_of(model.values[:, k] - origin[k]), 1, "model", points, width=0.9)
        for begin, end in removed:
            axis.axvspan(begin, end, color="0.85", linewidth=0.5)
        axis.set_ylabel(f"{name} / mm")
    legend(axes[0], 2)
    _time(axes[-1], recorded.t)
    return to_svg(figure)


@styled
def residuals(t: Series, epsilon: tuple[Series, np.ndarray] | None, missed: Course | None, points: int = POINTS) -> str:
    """Draw what the model leaves over: ε (N, K) of the equations, and Δ = recorded − model of the main marker in mm.

    t: the window's, so that all its pictures have the same abscissa.
    """
    rows = (epsilon is not None) + (missed is not None)
    figure, axes = sheet(WIDTH, 1.5 * rows + 0.6, rows)
    if missed is not None:
        for k, name in enumerate("xyz"):
            _line(axes[0], missed.t, millimetres_of(missed.values[:, k]), k, f"Δ{name}", points)
        _zero(axes[0])
        axes[0].set_ylabel("Δ / mm")
        legend(axes[0], 3)
    if epsilon is not None:
        times, values = epsilon
        for k in range(values.shape[1]):
            _line(axes[-1], times, values[:, k], k, f"ε{k + 1}", points)
        _zero(axes[-1])
        axes[-1].set_ylabel("ε / (m/s²)")
        legend(axes[-1], values.shape[1])
    _time(axes[-1], t)
    return to_svg(figure)


@styled
def tensions(t: Series, tension: CableSeries, limits: tuple[float, float], points: int = POINTS) -> str:
    """Draw each cable's tension (N) against the limits: the lower always, the upper where it is near."""
    figure, (axis,) = sheet(WIDTH, 2.3)
    for cable in range(tension.shape[1]):
        _line(axis, t, tension[:, cable], cable, f"cable {cable + 1}", points)
    _zero(axis)
    low, high = limits
    largest = float(np.max(tension, where=np.isfinite(tension), initial=0.0))
    axis.axhline(low, color="black", lw=0.9, ls=":")
    if largest > 0.5 * high:
        axis.axhline(high, color="black", lw=0.9, ls=":")
    axis.set_ylim(top=max(largest, low) * 1.25)
    axis.set_ylabel("tension / N")
    legend(axis, tension.shape[1])
    _time(axis, t)
    return to_svg(figure)


@dataclass(frozen=True)
class ParameterRow:
    """One identified parameter beside what else is known about it, all in one unit."""

    name: str
    value: float
    sd: float
    spread: float | None
    nominal: float | None
    true: float | None
    seen: bool = True
    """whether the recordings say anything of it"""


@styled
def parameters(rows: Sequence[ParameterRow]) -> str:
    """Draw each parameter's interval (±2 sd thick, ±2 spread thin), the CAD value and, if known, the truth.

    Each row has its own scale: the widest of its intervals and distances is its half width.
    """
    figure, (axis,) = sheet(WIDTH, 0.32 * len(rows) + 0.75, left=1.15)
    for y, row in enumerate(reversed(rows)):
        others = [abs(v - row.value) for v in (row.nominal, row.true) if v is not None]
        wide = max([2 * row.sd, 2 * (row.spread or 0.0), *others, 1e-12]) * 1.1
        if row.spread is not None:
            reach = 2 * row.spread / wide
            axis.plot([-reach, reach], [y, y], color=COLOURS[0], lw=1.2, marker="|", ms=7)
        axis.plot([-2 * row.sd / wide, 2 * row.sd / wide], [y, y], color=COLOURS[0], lw=4, solid_capstyle="butt")
        axis.plot(0.0, y, "o", color=COLOURS[0], ms=4, label="identified" if y == 0 else None)
        if row.nominal is not None:
            place = (row.nominal - row.value) / wide
            axis.plot(place, y, "s", color=COLOURS[4], ms=6, mfc="none", label="CAD" if y == 0 else None)
        if row.true is not None:
            place = (row.true - row.value) / wide
            axis.plot(place, y, "x", color=COLOURS[1], ms=7, label="true" if y == 0 else None)
    axis.set_yticks(range(len(rows)), [row.name for row in reversed(rows)])
    axis.set_xlim(-1.05, 1.05)
    axis.set_ylim(-0.6, len(rows) - 0.4)
    axis.set_xticks([])
    axis.set_xlabel("±2 sd thick, ±2 spread between windows thin; each row on its own scale")
    legend(axis, 3)
    return to_svg(figure)


@dataclass(frozen=True)
class Bar:
    """One window's σ⊥."""

    window: str
    sigma_perp: float
    held_out: bool


@styled
def cross_validation(bars: Sequence[Bar], sigma_W: float | None, expected: float | None) -> str:
    """Draw σ⊥ (Eq. 50) of each window against σ_W (Eq. 31), as Fig. 3; held-out windows dark, identified ones pale.

    expected: √λ ‖χ‖ σ_W, where a window as good as the identified ones should be.
    """
    figure, (axis,) = sheet(WIDTH, 2.7)
    for held_out, label in ((True, "held out"), (False, "identified from")):
        places = [k for k, bar in enumerate(bars) if bar.held_out is held_out]
        if places:
            heights = [bars[k].sigma_perp for k in places]
            colour, hatch = (COLOURS[0], None) if held_out else ("#d7e7f1", "///")
            axis.bar(places, heights, color=colour, hatch=hatch, edgecolor=COLOURS[0], lw=0.5, width=0.65, label=label)
    if sigma_W is not None:
        axis.axhline(sigma_W, color=COLOURS[1], ls=":", lw=1.4, label="σ_W of the fit")
    if expected is not None:
        axis.axhline(expected, color=COLOURS[2], ls="--", lw=1.4, label="expected σ⊥")
    crowded = len(bars) > 12
    axis.set_xticks(range(len(bars)), [_short(bar.window) for bar in bars], rotation=90 if crowded else 0)
    axis.grid(visible=False, axis="x")
    tallest = max([bar.sigma_perp for bar in bars] + [v for v in (sigma_W, expected) if v is not None])
    axis.set_ylim(0.0, 1.25 * tallest)
    axis.set_ylabel("σ⊥ / (m/s²)")
    legend(axis, 4)
    return to_svg(figure)


@dataclass(frozen=True)
class Bout:
    """A stretch of a run in which one kind of thing happened for one window."""

    window: str
    kind: str
    begin: float
    end: float
    """s"""


@styled
def timeline(windows: Sequence[str], kinds: Sequence[str], bouts: Sequence[Bout], marks: Sequence[float]) -> str:
    """Draw what was done when (s from the run's begin), a row for each window; `marks`: when something went amiss."""
    figure, (axis,) = sheet(WIDTH, 0.19 * len(windows) + 0.85, left=0.95)
    rows = {window: len(windows) - 1 - k for k, window in enumerate(windows)}
    for k, kind in enumerate(kinds):
        of_kind = [bout for bout in bouts if bout.kind == kind and bout.window in rows]
        if of_kind:
            axis.barh(
                [rows[bout.window] for bout in of_kind],
                [bout.end - bout.begin for bout in of_kind],
                left=[bout.begin for bout in of_kind],
                height=0.8,
                color=COLOURS[k % len(COLOURS)],
                label=kind,
            )
    for mark in marks:
        axis.axvline(mark, color="black", lw=0.8, ls=":")
    axis.set_yticks(range(len(windows)), [_short(window) for window in reversed(windows)])
    axis.tick_params(axis="y", labelsize=7)
    axis.grid(visible=False, axis="y")
    axis.set_ylim(-0.7, len(windows) - 0.3)
    axis.set_xlabel("t / s")
    handles, _ = axis.get_legend_handles_labels()
    if handles:
        axis.legend(loc="lower right", bbox_to_anchor=(1.0, 0.99), ncols=5, fontsize=8, borderaxespad=0.1)
    return to_svg(figure)


def millimetres_of(metres: Series) -> Series:
    """Metres to millimetres, for showing."""
    return metres * millimetres(1.0)


def _line(axis: Axes, t: Series, values: Series, k: int, label: str, points: int, width: float = 0.9) -> None:
    style = STYLES[k % len(STYLES)]
    axis.plot(*thin(t, values, points), color=COLOURS[k % len(COLOURS)], ls=style, lw=width, label=label)


def plain_ticks(*axes: Axis) -> None:
    """Numbers as they are read, on axes that are logarithmic: our text is never parsed as maths."""
    for axis in axes:
        axis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axis.set_minor_formatter(NullFormatter())


def sd_levels(low: float, high: float) -> list[float]:
    """Ticks of bars in standard deviations: from 2 on, within what is drawn."""
    steps = [2.0, *([5.0] if max(-low, high) < 50.0 else []), *(10.0**k for k in range(1, 9))]
    return [*(-step for step in reversed(steps) if -step >= low), 0.0, *(step for step in steps if step <= high)]


def legend(axis: Axes, columns: int) -> None:
    """Above the axes, where it covers nothing."""
    axis.legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=columns, fontsize=8, borderaxespad=0.1)


def _zero(axis: Axes) -> None:
    axis.axhline(0.0, color="black", lw=0.6)


def _time(axis: Axes, t: Series) -> None:
    axis.set_xlim(t[0], t[-1])
    axis.set_xlabel("t / s")


def _mean(values: Positions) -> Vector3:
    seen = values[np.isfinite(values).all(axis=1)]
    return seen.mean(axis=0) if len(seen) else np.zeros(3)


def _short(name: str) -> str:
    return name if len(name) <= 12 else f"{name[:11]}…"


def correlations(result: IdentificationResult) -> Drawing | None:
    """The correlation matrix of the nine parameters by the nominal covariance; None where there is none."""
    sd = np.sqrt(np.diag(result.covariance))
    if not np.isfinite(sd).all() or not (sd > 0).all():
        return None
    values = result.covariance / np.outer(sd, sd)
    return Drawing(matrix(values), _caption(values), "correlations")


@styled
def matrix(values: Float[np.ndarray, "9 9"]) -> str:
    """Draw correlations as coloured cells with their value in per cent; blue goes together, orange against."""
    figure, (axis,) = sheet(5.2, 4.4, left=0.6)
    size = len(values)
    axis.pcolormesh(
        np.arange(size + 1), np.arange(size + 1), values, vmin=-1.0, vmax=1.0, cmap="PuOr", edgecolors="white"
    )
    for (row, column), value in np.ndenumerate(values):
        colour = "white" if abs(value) > DARK else "black"
        axis.text(column + 0.5, row + 0.5, f"{round(100 * value)}", ha="center", va="center", fontsize=8, color=colour)
    axis.set_xticks(np.arange(size) + 0.5, list(PARAMETER_NAMES))
    axis.set_yticks(np.arange(size) + 0.5, list(PARAMETER_NAMES))
    axis.tick_params(length=0)
    axis.grid(visible=False)
    axis.invert_yaxis()
    return to_svg(figure)


def _caption(values: Float[np.ndarray, "9 9"]) -> str:
    pairs = [(abs(values[i, k]), values[i, k], i, k) for i in range(len(values)) for k in range(i)]
    strong = sorted((pair for pair in pairs if pair[0] >= STRONG), reverse=True)
    tied = ", ".join(
        f"{PARAMETER_NAMES[k]} with {PARAMETER_NAMES[i]} ({100 * rho:+.0f} %)" for _, rho, i, k in strong[:4]
    )
    said = f"hardly separable: {tied}" if tied else f"none beyond {100 * STRONG:.0f} %"
    return f"Correlations of the identified parameters by the nominal covariance, %; {said}."
