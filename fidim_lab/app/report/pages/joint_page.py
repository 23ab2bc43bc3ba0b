"""The page of `fidim identify A B C --report`: the joint body, and what predicts what."""

from pathlib import Path

import numpy as np

from fidim_lab.app.report.drawings.drawing import Drawing
from fidim_lab.app.report.drawings.figures import WIDTH, legend, plain_ticks
from fidim_lab.app.report.drawings.svg import COLOURS, sheet, styled, to_svg
from fidim_lab.app.report.pages.compare_page import ComparePage
from fidim_lab.app.report.pages.html import render
from fidim_lab.app.report.pages.write import write_page
from fidim_lab.app.report.sections.joint import closing, cross_table
from fidim_lab.app.report.sections.numerals import decimals, fixed
from fidim_lab.app.report.sections.tables import ReportTable
from fidim_lab.identification.joint.identify import JointResult
from fidim_lab.identification.results.result import InertialParameter
from fidim_lab.units import millimetres


def write_joint_page(found: JointResult, out: Path) -> Path:
    """Write the page; returns its path. Raises FileError where it cannot be written."""
    result = found.result
    page = ComparePage(
        title=result.campaign,
        badges=("✓ identified" if result.outcome.answers else "✗ not identified",),
        summary=(*result.answer.parts, ("Worth", closing(found))),
        warnings=result.warnings,
        tables=_tables(found),
        drawings=(Drawing(_windows(found), "rms of every window, fitted and held out, in mm.", "windows"),),
        kind="One body from several campaigns",
    )
    return write_page(render("compare.html.jinja", page), out, None)


def _tables(found: JointResult) -> tuple[ReportTable, ...]:
    result = found.result
    caption = "Parameters about P, per unit mass: s in mm, I in 10⁻³ m²; ±: including the uncertainty of the survey"
    parameters = ReportTable(
        caption,
        ("parameter", "CAD", "identified", "±"),
        tuple(_cells(name, one) for name, one in result.parameters.items()),
    )
    moved = () if result.geometry is None else result.geometry.moved
    geometry = ReportTable(
        "Geometry against the robot files, mm or mrad",
        ("what", "cable", "off by", "±"),
        tuple(
            (
                one.what,
                "" if one.cable is None else str(one.cable),
                ", ".join(f"{1e3 * value:+.2f}" for value in one.by),
                ", ".join(f"{1e3 * value:.2f}" for value in one.sd),
            )
            for one in moved
        ),
    )
    return (parameters, *cross_table(found), *([geometry] if moved else []))


def _cells(name: str, one: InertialParameter) -> tuple[str, ...]:
    sd = max(one.sd, one.spread or 0.0)
    places = decimals(millimetres(sd))
    return (name, *(fixed(millimetres(value), places) for value in (one.nominal, one.value, sd)))


@styled
def _windows(found: JointResult) -> str:
    figure, (axis,) = sheet(WIDTH, 2.4)
    windows = [one for one in found.result.windows if one.rms_mm is not None]
    for k, campaign in enumerate(found.campaigns):
        mine = [(x, one.rms_mm) for x, one in enumerate(windows) if one.id.startswith(f"{campaign}/")]
        if mine:
            axis.plot(
                *np.array(mine, dtype=float).T, "osD^v<>p"[k % 8], color=COLOURS[k % len(COLOURS)], label=campaign
            )
    axis.set_yscale("log")
    plain_ticks(axis.yaxis)
    axis.set_xticks([])
    axis.set_xlabel("windows")
    axis.set_ylabel("rms, mm")
    legend(axis, 3)
    return to_svg(figure)
