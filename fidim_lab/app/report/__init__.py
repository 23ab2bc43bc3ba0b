"""The HTML report of a run or campaign: one file that opens offline; script only turns, zooms and copies.

`write` is the door; `folder`, `story`, `provenance` gather what a folder holds; `figures`, `spectra`, `scene`, `solid`
draw it (`svg`, `drawing`); `words`, `tables`, `windows`, `copies` say it; `page` puts it together, `html` sets it.
`explain_page` is the door to what was left out: `explanation_file`, `proof`, `proof_figures`, `explained`.
"""

from pathlib import Path


def report_command(folder: Path, out: Path | None, pictures: Path | None = None, json_file: Path | None = None) -> int:
    """What `fidim report` does. Returns the exit code; raises FileError for a wrong folder."""
    from fidim_lab.app.formats.answer_file import write_answer
    from fidim_lab.app.report.write import write_report
    from fidim_lab.app.terminal import console
    from fidim_lab.app.terminal.working import Working, windows_of

    with Working("identifying and drawing", windows_of(folder)):
        path = write_report(folder, None, out, pictures)
    console.out.print(f"Report      {path}", markup=False)
    if pictures is not None:
        console.out.print(f"Pictures    {pictures}", markup=False)
    made = {"file": str(path), "bytes": path.stat().st_size, "pictures": None if pictures is None else str(pictures)}
    write_answer(json_file, "fidim-report/1", made)
    return 0
