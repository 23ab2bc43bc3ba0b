"""Which parameters cannot be told apart: the picture of their correlations, and the strongest ties in words."""

import numpy as np
from jaxtyping import Float

from fidim_lab.app.report.drawings.drawing import Drawing
from fidim_lab.app.report.drawings.svg import sheet, styled, to_svg
from fidim_lab.data.records import PARAMETER_NAMES
from fidim_lab.identification.results.result import IdentificationResult

STRONG = 0.9
"""correlation from which two parameters are named as tied"""
DARK = 0.6
"""beyond, the cell is so dark that its number must be white"""


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
