"""What `fidim identify` shows a person: parameters, windows, warnings, how far to trust it, and what to do next.

Warnings are in the summary because they belong to the answer. `fidim dry-run` and joint fits show the same tables.
"""

from pathlib import Path
from shlex import quote

import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from fidim_lab.app.terminal import console
from fidim_lab.app.workflows.identify import closing_sentence
from fidim_lab.data.campaign import ROBOT
from fidim_lab.identification.design.task import DISPLACED
from fidim_lab.identification.mle.periods.by_periods import VARIANT as BY_PERIODS
from fidim_lab.identification.results.result import (
    IdentificationResult,
    InertialParameter,
    ResultOutcome,
    WindowVerdict,
)
from fidim_lab.identification.results.validation import expected_sigma_perp
from fidim_lab.units import millimetres, percent, plain


def summary(result: IdentificationResult) -> RenderableType:
    """The whole answer for a terminal: four short parts, tables, warnings, and how far to trust it."""
    parts: list[RenderableType] = [
        *console.answer(f"{result.campaign}: {result.outcome.code}", result.answer.parts),
        parameter_table(result),
        gauge_table(result),
        window_table(result),
        *(Text(f"warning: {warning}", style="yellow") for warning in result.warnings),
        Text(closing_sentence(result), style="bold"),
    ]
    return Group(*parts)


def parameter_table(result: IdentificationResult) -> Table:
    """CAD, identified, nominal sd, spread between windows, and that spread in percent, for all nine.

    Where parameters were dropped as non-essential, the others fitted anew without them stand beside.
    """
    table = Table(title="Inertial parameters (s in mm, I in 1e-3 m² per unit mass, about P)")
    refits = ["re-fit"] if result.non_essential else []
    console.columns(table, "parameter", "CAD", "identified", "sd", "spread", "spread, %", *refits)
    for name, parameter in result.parameters.items():
        refit = parameter.without_non_essential
        shown = "" if refit is None else "dropped" if name in result.non_essential else f"{millimetres(refit):.3f}"
        table.add_row(*_cells(name, parameter), *(shown for _ in refits))
    return table


def gauge_table(result: IdentificationResult) -> Table:
    """What does not depend on where P is put: s_z from the attachment plane, and I about G."""
    table = Table(title="Independent of the choice of P: s_z from the plane of the attachments (mean a_z), I about G")
    console.columns(table, "parameter", "CAD", "identified", "sd", "spread", "spread, %")
    s_z, plane = result.parameters["s_z"], result.attachment_plane
    relative = InertialParameter(
        s_z.value - plane, s_z.sd, s_z.sd_bootstrap, s_z.sd_jackknife, s_z.nominal - plane, seen=s_z.seen
    )
    table.add_row(*_cells("s_z − a_z", relative))
    for name, parameter in result.about_com().items():
        table.add_row(*_cells(f"{name} about G", parameter))
    return table


def window_table(result: IdentificationResult) -> Table:
    """Every window with σ⊥ and, where it was predicted, the error of the trajectory."""
    expected = None
    if result.sigma_W is not None:
        expected = expected_sigma_perp(result.sigma_W, result.body, result.freedoms)
    scale = "" if result.sigma_W is None else f"; σ_W = {result.sigma_W:.3g}, so σ⊥ ≈ {expected:.3g} is expected"
    table = Table(
        title=f"Windows (σ⊥: residual of the equations of motion{scale}; rms and χ²/dof: of the predicted motion)"
    )
    console.columns(table, "window", "role", "pose from", "samples", "σ⊥", "rms, mm", "χ²/dof", "conditioning")
    for window in result.windows:
        table.add_row(*_window_cells(window))
    table.caption, table.caption_justify = result.no_sigma or None, "left"
    return table


def next_command(folder: Path, result: IdentificationResult, json_file: Path | None) -> str:
    """The command that follows from this result of a campaign, as it may be typed."""
    place = quote(str(folder))
    if result.windows and all(one.variant == BY_PERIODS for one in result.windows) and not result.outcome.good:
        return f"fidim import periods TABLE --robot {quote(str(folder / ROBOT))} --out again"
    if not result.outcome.answers or result.fallback:
        return f"fidim explain {place}"
    if json_file is None:  # what all that follows takes
        return f"fidim identify {place} --json {quote(str(folder / 'result.json'))}"
    kept = quote(str(json_file))
    if result.outcome is ResultOutcome.DOUBTFUL and result.freedoms > DISPLACED:  # more windows, at places at random
        return f"fidim dry-run --robot {quote(str(folder / ROBOT))} --out rehearsal"
    if result.outcome is ResultOutcome.DOUBTFUL:
        return f"fidim design --after {kept} --campaign {place} --out next"
    return f"fidim export {kept} --to python --campaign {place} --out robot.py"


def _cells(name: str, parameter: InertialParameter) -> tuple[str, ...]:
    """Both kinds happen to read well in thousandths: s in mm, I in 1e-3 m²."""
    spread = parameter.spread
    size = abs(parameter.value)
    digits = _decimals(parameter.sd)
    if not parameter.seen:
        return (name, f"{millimetres(parameter.nominal):.3f}", "not determined", "", "", "")
    return (
        name,
        f"{millimetres(parameter.nominal):.3f}",
        f"{millimetres(parameter.value):.{digits}f}",
        f"{millimetres(parameter.sd):.{digits}f}",
        "unknown" if spread is None else f"{millimetres(spread):.{digits}f}",
        "" if spread is None or size == 0 else _percent(spread / size),
    )


def _decimals(sd: float) -> int:
    """Three, or as many as show two digits of the standard deviation."""
    return 3 if sd <= 0 else int(np.clip(1 - np.floor(np.log10(millimetres(sd))), 3, 6))


def _window_cells(window: WindowVerdict) -> tuple[str, ...]:
    if not window.used:
        return (window.id, window.role.value, "not used", "", "", "", "", "")
    return (
        window.id,
        window.role.value,
        window.variant or "",
        str(window.samples),
        _number(window.sigma_perp),
        _number(window.rms_mm),
        _number(window.chi2_per_dof),
        _number(window.conditioning),
    )


def _percent(ratio: float) -> str:
    return "> 100" if ratio > 1 else f"{percent(ratio):.2g}"


def _number(value: float | None) -> str:
    return "–" if value is None else plain(value)
