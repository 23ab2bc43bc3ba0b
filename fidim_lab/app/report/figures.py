"""Pictures of the report, each returned as SVG text: trajectories, tensions, residuals, parameters, cross-validation.

Drawn by matplotlib without a screen; the same data give the same bytes. Colours are those of Okabe and Ito,
which colour-blind people can tell apart; lines differ in style too.
"""

import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fidim_lab.arrays import CableSeries, Series

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
STYLES = ("-", "--", "-.", ":", (0, (5, 1)), (0, (1, 1)))
POINTS = 400
"""samples drawn for each line: more than the eye sees, few enough for a small file"""

_STYLE: dict[Any, Any] = {
    "svg.hashsalt": "fidim",
    "svg.fonttype": "none",
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "path.simplify": True,
    "path.simplify_threshold": 0.5,
}


def _svg(figure: Figure) -> str:
    buffer = io.StringIO()
    with mpl.rc_context(_STYLE):
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    text = buffer.getvalue()
    return text[text.index("<svg") :]


def _figure(width: float, height: float, rows: int = 1) -> tuple[Figure, list[Axes]]:
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(width, height), layout="constrained")
        axes = figure.subplots(rows, 1, sharex=True, squeeze=False)
    return figure, list(axes[:, 0])


def _thin(samples: int) -> slice:
    return slice(None, None, max(1, samples // POINTS))


def trajectory(t: Series, marker: np.ndarray, rest: np.ndarray | None, model: np.ndarray | None) -> str:
    """Draw the main marker (N, 3) against time, in mm from rest, the model's prediction over it."""
    figure, axes = _figure(6.4, 3.4, rows=3)
    origin = np.nanmean(marker, axis=0) if rest is None else rest
    pick = _thin(len(t))
    for k, (axis, name) in enumerate(zip(axes, "xyz", strict=True)):
        axis.plot(t[pick], (marker[pick, k] - origin[k]) * 1e3, color=COLOURS[0], lw=1.0, label="recorded")
        if model is not None:
            axis.plot(t[pick], (model[pick, k] - origin[k]) * 1e3, color=COLOURS[1], lw=0.8, ls="--", label="model")
        axis.set_ylabel(f"{name} / mm")
    axes[0].legend(loc="upper right", ncols=2, frameon=False)
    axes[-1].set_xlabel("t / s")
    return _svg(figure)


def tensions(t: Series, tension: CableSeries, limits: tuple[float, float]) -> str:
    """Draw each cable's tension (N) from its motor current against the limits."""
    figure, (axis,) = _figure(6.4, 2.2)
    pick = _thin(len(t))
    for cable in range(tension.shape[1]):
        axis.plot(
            t[pick],
            tension[pick, cable],
            lw=0.8,
            color=COLOURS[cable % len(COLOURS)],
            ls=STYLES[cable % len(STYLES)],
            label=f"cable {cable + 1}",
        )
    axis.axhline(0.0, color="black", lw=0.8)
    for limit in limits:
        if np.nanmax(tension) > 0.5 * limit:
            axis.axhline(limit, color="black", lw=0.8, ls=":")
    axis.set_ylabel("tension / N")
    axis.set_xlabel("t / s")
    axis.legend(loc="upper right", ncols=tension.shape[1], frameon=False)
    return _svg(figure)


def residuals(t: Series, residual: np.ndarray, unit: str) -> str:
    """Draw the residual (N, K) of the identification model against time."""
    figure, (axis,) = _figure(6.4, 2.0)
    for k in range(residual.shape[1]):
        axis.plot(t, residual[:, k], lw=0.8, color=COLOURS[k], ls=STYLES[k], label=f"freedom {k + 1}")
    axis.axhline(0.0, color="black", lw=0.6)
    axis.set_ylabel(f"residual / {unit}")
    axis.set_xlabel("t / s")
    axis.legend(loc="upper right", ncols=2, frameon=False)
    return _svg(figure)


@dataclass(frozen=True)
class ParameterRow:
    """One identified parameter beside what else is known about it."""

    name: str
    unit: str
    value: float
    sd: float
    spread: float | None
    nominal: float | None
    true: float | None


def parameters(rows: Sequence[ParameterRow]) -> str:
    """Draw each parameter's interval (±2 sd thick, ±2 spread thin), the CAD value and, if known, the truth.

    Each row has its own scale: the widest of its intervals and distances is its half width.
    """
    figure, (axis,) = _figure(6.4, 0.45 * len(rows) + 0.8)
    for k, row in enumerate(rows):
        others = [abs(v - row.value) for v in (row.nominal, row.true) if v is not None]
        wide = max([2 * row.sd, 2 * (row.spread or 0.0), *others, 1e-12]) * 1.1
        y = len(rows) - 1 - k
        if row.spread is not None:
            axis.plot([-2 * row.spread / wide, 2 * row.spread / wide], [y, y], color=COLOURS[0], lw=1.2)
        axis.plot([-2 * row.sd / wide, 2 * row.sd / wide], [y, y], color=COLOURS[0], lw=4, solid_capstyle="butt")
        axis.plot(0.0, y, "o", color=COLOURS[0], ms=4)
        if row.nominal is not None:
            axis.plot((row.nominal - row.value) / wide, y, "s", color=COLOURS[4], ms=5, mfc="none")
        if row.true is not None:
            axis.plot((row.true - row.value) / wide, y, "x", color=COLOURS[1], ms=6)
    axis.set_yticks(range(len(rows)), [row.name for row in reversed(rows)])
    axis.set_xlim(-1.05, 1.05)
    axis.set_xticks([])
    axis.set_xlabel("○ identified ±2 sd (thick), ±2 spread (thin)   □ CAD   × true;  each row on its own scale")
    return _svg(figure)


def cross_validation(ids: Sequence[str], sigma: Sequence[float], sigma_w: float | None) -> str:
    """Draw σ⊥ of Eq. 50 for each held-out window against σ_W, as Fig. 3."""
    figure, (axis,) = _figure(6.4, 2.4)
    axis.bar(range(len(ids)), sigma, color=COLOURS[0], width=0.6)
    if sigma_w is not None:
        axis.axhline(sigma_w, color=COLOURS[1], ls="--", lw=1.2, label="σ_W of the fit")
        axis.legend(frameon=False)
    axis.set_xticks(range(len(ids)), list(ids))
    axis.set_ylabel("σ⊥")
    return _svg(figure)
