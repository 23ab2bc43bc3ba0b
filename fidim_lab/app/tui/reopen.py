"""From a run that has ended back to one that can go on: its service is started again, latched, and the screen finds it.

Nothing moves by it: the emergency stop is reset (r) and the run begun (g) as in any other service.
"""

from pathlib import Path

from drivers.clock import LoopClock
from fidim_lab.app.formats.run_spec import RunSpec, again, read_spec
from fidim_lab.app.service.lock import holder
from fidim_lab.app.service.own_process import end_service, serves, service_process, until_it_listens
from fidim_lab.app.service.place import ServicePlace, place_of
from fidim_lab.app.tui.aside import Aside
from fidim_lab.data.rigs.rig_file import read_rig
from fidim_lab.errors import RefusedError


async def reopen(folder: Path) -> str:
    """Start the service of the run in this folder; returns what was left out. Raises FidimError where it cannot be."""
    spec, place, says = await Aside(LoopClock()).run(lambda: _read(folder))
    if (who := holder(place)) is not None and serves(who, folder) and (refusal := await end_service(place)):
        raise RefusedError(f"The service of this run is still running, and {refusal}")
    with service_process(spec, place) as process:
        await until_it_listens(place, process)
    return says


def _read(folder: Path) -> tuple[RunSpec, ServicePlace, str]:
    spec = again(read_spec(folder), folder.absolute())
    if spec.procedure.endswith(".py"):
        raise RefusedError(
            f"The procedure is a Python file ({spec.procedure}).",
            hint=f"To be asked whether to execute it: fidim resume {folder}",
        )
    says = "Its commands on-finish and on-fault will not be executed. " if spec.on_finish or spec.on_fault else ""
    spec = spec.model_copy(update={"on_finish": "", "on_fault": ""})
    file = read_rig(spec.rig)
    return spec, place_of(file, embedded=spec.embedded, run=spec.own_place), says
