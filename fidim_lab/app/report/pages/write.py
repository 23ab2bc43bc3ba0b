"""`write_report`: the one door to the report. It imports what it needs when called: the command line stays quick."""

from pathlib import Path
from typing import TYPE_CHECKING

from fidim_lab.data.files.whole_file import put_whole
from fidim_lab.errors import FileError, RefusedError

if TYPE_CHECKING:
    from fidim_lab.app.report.contents.folder import Contents
    from fidim_lab.app.report.pages.html import Rendered
    from fidim_lab.app.report.sections.explained import ExplanationSection
    from fidim_lab.identification.results.result import IdentificationResult

NAME = "report.html"


def write_report(
    folder: Path,
    result: "IdentificationResult | None" = None,
    out: Path | None = None,
    pictures: Path | None = None,
) -> Path:
    """Write the HTML report of a run, campaign or import folder, whole or not at all; returns its path.

    `result`: what was identified from this folder; identified here when not given, and where that is refused the report
    says so. `out`: default FOLDER/report.html. `pictures`: a folder for all pictures as SVG files. What was left out is
    told where FOLDER/explanation.json is. Raises FileError where the folder cannot be read or `out` not written.
    """
    from fidim_lab.app.report.contents.folder import read_folder
    from fidim_lab.app.report.pages.html import render
    from fidim_lab.app.report.pages.page import make_page

    contents = read_folder(folder)
    explanation = _explained(folder, contents)  # a file that is refused costs no time before
    found, trust = _judged(folder, contents, result)
    rendered = render("page.html.jinja", make_page(contents, found, trust, explanation))
    return write_page(rendered, folder / NAME if out is None else out, pictures)


def write_page(rendered: "Rendered", path: Path, pictures: Path | None) -> Path:
    """Write a page whole or not at all, and its pictures where asked for; returns its path. Raises FileError."""
    from fidim_lab.app.report.drawings.drawing import write_pictures

    try:
        put_whole(path, rendered.html)
    except OSError as error:
        raise FileError(path, "", f"cannot be written: {error.strerror}") from None
    if pictures is not None:
        write_pictures(pictures, rendered.drawings)
    return path


def _explained(folder: Path, contents: "Contents") -> "ExplanationSection | None":
    """What explanation.json beside the campaign says; None where there is none."""
    from fidim_lab.app.formats.explanation_file import EXPLANATION

    path = folder / EXPLANATION
    if not path.exists() or not contents.campaign.windows:
        return None
    from fidim_lab.app.formats.explanation_file import read_explanation
    from fidim_lab.app.report.contents.proof import proof
    from fidim_lab.app.report.sections.explained import explained

    found = read_explanation(path)
    return explained(found, proof(found, contents.campaign), contents.campaign.robot.sensors.marker_noise)


def _judged(
    folder: Path, contents: "Contents", result: "IdentificationResult | None"
) -> "tuple[IdentificationResult | None, str]":
    """The result with how far to trust it, or None with the reason."""
    from fidim_lab.app.workflows.identify import closing_sentence, run_identify

    if result is None:
        if not contents.campaign.windows:
            return None, "The run ended before the first window was accepted."
        try:
            result = run_identify(folder)
        except RefusedError as refusal:
            return None, str(refusal)
    return result, closing_sentence(result)
