"""`fidim resume`: go on with a run, however it ended, from its folder alone."""

from pathlib import Path

from fidim_lab.app import console
from fidim_lab.app.run import require_answers, start_and_watch
from fidim_lab.app.service.main import prepare
from fidim_lab.app.service.spec import read_spec


def resume_command(folder: Path, *, accept_place: bool) -> int:
    """Returns the run's exit code. Raises FileError for no run, RefusedError where nothing is left to do."""
    spec = read_spec(folder).model_copy(update={"out": folder.absolute(), "resume": True, "accept_place": accept_place})
    work = prepare(spec)
    known = work.resumption.rows if work.resumption else {}
    left = len(work.experiment.roles) - len(known)
    console.err.print(f"{len(known)} windows have their verdict, {left} are left.", markup=False)
    require_answers(work)
    return start_and_watch(work)
