"""What is said after a run that did not end well: of drives, a latched stop, a computer that has too much to do.

Guards judge by what they see: samples that come late are late, whatever the reason, and a real robot would move on
meanwhile. So a rehearsal whose simulators share an overloaded computer is stopped honestly; only the cause is not at
the winches.
"""

import os
import shlex
from collections.abc import Iterable

from fidim_lab.app.formats.run_spec import RunSpec, read_summary
from fidim_lab.app.session.undo_stop import stop_hint
from fidim_lab.app.terminal import console
from fidim_lab.errors import HardwareError

EMERGENCY_STOP = "The emergency stop guard"
"""how the reason of a run that a person stopped begins"""


def advise(spec: RunSpec, code: int, power: Iterable[str]) -> None:
    """Say on standard error what to do after a run with this exit code; nothing after one that ended well.

    power: lines about drives that hold the load.
    """
    for line in (*power, *stop_hint(spec), *load_advice(spec, code)) if code else ():
        console.err.print(line, markup=False, soft_wrap=True)


def load_advice(spec: RunSpec, code: int, load: float | None = None, cores: int | None = None) -> tuple[str, ...]:
    """Lines to print after a run with this exit code; none where the computer had time.

    Nothing is said where a person stopped it.
    load: processes that wanted to compute, mean of the last minute; cores: for how many there is room.
    """
    cores = cores or os.cpu_count() or 1
    load = os.getloadavg()[0] if load is None else load
    reason = str(read_summary(spec.out).get("reason", ""))
    if code != HardwareError.exit_code or load <= cores or EMERGENCY_STOP in reason:
        return ()
    where = (
        "The simulated drives run on it too, so delays may come from this computer."
        if spec.embedded
        else "Data may be received late."
    )
    return (
        f"This computer was busy, too: in the last minute {load:.1f} processes competed for its {cores} cores. {where}",
        "If late data was the cause, end other programs, then:",
        f"    fidim resume {shlex.quote(str(spec.out))}",
    )
