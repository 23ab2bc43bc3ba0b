"""The HTML report of a run or campaign: one file that opens offline; script only turns, zooms and copies.

`contents` gathers what a folder holds; `drawings` draws it; `sections` say it in tables and sentences; `pages` put it
together. Doors: `pages.write`, `pages.explain_page`, `pages.compare_page`, `pages.joint_page`, imported when they are
called, so that the command line stays quick.
"""

from pathlib import Path


def report_command(folder: Path, out: Path | None, pictures: Path | None = None, json_file: Path | None = None) -> int:
    """What `fidim report` does. Returns the exit code; raises FileError for a wrong folder."""
    from fidim_lab.app.formats.answer_file import write_answer
    from fidim_lab.app.report.pages.write import write_report
    from fidim_lab.app.terminal import console
    from fidim_lab.app.terminal.working import Working, windows_of

    with Working("identifying and drawing", windows_of(folder)):
        path = write_report(folder, None, out, pictures)
    console.out.print(f"report      {path}", markup=False)
    if pictures is not None:
        console.out.print(f"Pictures    {pictures}", markup=False)
    made = {"file": str(path), "bytes": path.stat().st_size, "pictures": None if pictures is None else str(pictures)}
    write_answer(json_file, "fidim-report/1", made)
    return 0
