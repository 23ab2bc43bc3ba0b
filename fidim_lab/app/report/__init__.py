"""The HTML report of a run or campaign: one file that opens offline, without script.

`write` is the door; `folder`, `story`, `provenance` gather what a folder holds; `figures`, `scene` draw it (`svg`);
`words`, `tables`, `windows` say it; `page` puts it together with page.html.jinja and page.css.
"""

from pathlib import Path


def report_command(folder: Path, out: Path | None) -> int:
    """What `fidim report` does. Returns the exit code; raises FileError for a wrong folder."""
    from fidim_lab.app import console
    from fidim_lab.app.report.write import write_report

    with console.err.status("identifying and drawing …"):
        path = write_report(folder, None, out)
    console.out.print(f"Report      {path}", markup=False)
    return 0
