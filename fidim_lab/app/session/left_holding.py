"""What to type where a new run finds drives with power: who left them so, and the two ways on.

A new run does not take them over as `fidim resume` does: it has no journal that says where the robot was left, and they
may be another program's. A person decides, between going on with the old run and letting go of the load.
"""

import shlex
from pathlib import Path

from drivers.cia402.bring_up import HAS_POWER
from fidim_lab.app.formats.run_spec import read_summary
from fidim_lab.app.service.lock import left_behind
from fidim_lab.app.service.place import ServicePlace


def left_by(place: ServicePlace) -> Path | None:
    """The folder of a run whose service was killed while it had this rig; None where the last one ended by itself.

    To be asked before a service of one's own takes the lock.
    """
    told = left_behind(place)
    folder = None if told is None else Path(told.folder)
    return folder if folder is not None and folder.is_dir() else None


def power_advice(out: Path, rig: Path, left: Path | None) -> tuple[str, ...]:
    """Lines to print after a run (its folder `out`) that ended because a drive had power; none where it did not."""
    if HAS_POWER not in str(read_summary(out).get("reason", "")):
        return ()
    resume = f"    fidim resume {shlex.quote(str(left)) if left else 'FOLDER_OF_THAT_RUN'}"
    return (
        "The drives hold the load; an earlier run or another program left them so.",
        "To continue an interrupted run, with the load held throughout:",
        resume,
        "To start again, secure the load, then:",
        f"    fidim power-off {shlex.quote(str(rig))}",
        "    and repeat the fidim run command with another --out.",
    )
