"""What a computer that has too much to do has to do with a run that was stopped: said after it, never held against it.

Guards judge by what they see: samples that come late are late, whatever the reason, and a real robot would move on
meanwhile. So a rehearsal whose simulators share an overloaded computer is stopped honestly; only the cause is not at
the winches.
"""

import os
import shlex

from fidim_lab.app.service.spec import RunSpec
from fidim_lab.errors import HardwareError


def load_advice(spec: RunSpec, code: int, load: float | None = None, cores: int | None = None) -> tuple[str, ...]:
    """Lines to print after a run with this exit code; none where the computer had time.

    load: processes that wanted to compute, mean of the last minute; cores: for how many there is room.
    """
    cores = cores or os.cpu_count() or 1
    load = os.getloadavg()[0] if load is None else load
    if code != HardwareError.exit_code or load <= cores:
        return ()
    where = (
        "The simulated drives share it, so that is the probable cause."
        if spec.embedded
        else "What it hears comes late."
    )
    return (
        f"This computer is overloaded: in the last minute {load:.1f} processes wanted its {cores} cores. {where}",
        "End what else it computes, then:",
        f"    fidim resume {shlex.quote(str(spec.out))}",
    )
