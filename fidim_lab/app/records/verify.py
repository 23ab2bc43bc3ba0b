"""`fidim verify`: is a run's folder what it was when the run ended?"""

from dataclasses import asdict
from pathlib import Path

from fidim_lab.app.formats.answer_file import write_answer
from fidim_lab.app.formats.manifest import verify
from fidim_lab.app.terminal import console
from fidim_lab.say import printable

FORMAT = "fidim-verification/1"


def verify_command(folder: Path, json_file: Path | None) -> int:
    """Verify and say what is wrong, file by file; 0 intact, 1 not. Raises FileError (2) where there is no manifest."""
    found = verify(folder)
    write_answer(json_file, FORMAT, {"folder": folder.name, "intact": found.intact, **asdict(found)})
    for what, names in (("changed", found.changed), ("missing", found.missing), ("extra", found.extra)):
        for name in names:
            console.out.print(f"{what:8} {printable(name)}", markup=False)
    if found.versions:
        console.warn([f"recorded with other software: {'; '.join(found.versions)}"])
    wrong = len(found.changed) + len(found.missing) + len(found.extra)
    verdict = "intact" if found.intact else f"not intact: {wrong} difference{'s' * (wrong != 1)}"
    console.out.print(f"{printable(str(folder))}: {verdict}, {found.checked} files as they were recorded", markup=False)
    return 0 if found.intact else 1
