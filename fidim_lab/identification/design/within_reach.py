"""Windows that winches can excite: displacements that they reach even at the largest expected damping.

What a hand may give is beyond winches at most places, since their strokes pull at the cables on top of the swing. A
plan that `fidim run --procedure excite` is to carry out wants no more than they reach: then every window swings as it
says.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from fidim_lab.errors import InfeasibleError, OurBugError
from fidim_lab.identification.design import pool
from fidim_lab.identification.design.task import DesignTask
from fidim_lab.identification.excitation.bodies import Bodies
from fidim_lab.identification.excitation.knowledge import SURE, Knowledge
from fidim_lab.identification.excitation.place import ExcitationPlace, wanted_amplitudes
from fidim_lab.identification.excitation.plan import planned
from fidim_lab.mapping import Map
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.say import Say

CERTAIN = 0.75
"""part of what is planned for the nominal body that is wanted: another one may reach less. With 0.9 eleven of 235 runs
could not be as wanted after their second try: their bodies reached 0.61 to 0.88 of it, all but two more than 0.7"""
TOGETHER = 4
"""windows that one process looks at before it tells"""


@dataclass(frozen=True, eq=False)
class Some:
    """A few windows; self-contained, so that another process can look at them."""

    task: DesignTask
    z: Float[np.ndarray, "K z"]


def within_reach(
    mechanism: Mechanism,
    task: DesignTask,
    drawn: pool.Pool,
    run: Map,
    say: Say,
) -> pool.Pool:
    """The same windows with displacements that winches reach; windows that they hardly excite are left out.

    Raises InfeasibleError where too few are left.
    """
    parts = [Some(task, drawn.z[k : k + TOGETHER]) for k in range(0, len(drawn.z), TOGETHER)]
    found: list[np.ndarray] = []
    for k, some in enumerate(run(reached, parts), start=1):
        found.extend(some)
        say(f"what winches reach: {min(k * TOGETHER, len(drawn.z))} of {len(drawn.z)} windows")
    if len(found) < task.equilibria:
        raise InfeasibleError(
            f"Winches can excite the platform at {len(found)} of {len(drawn.z)} random places; {task.equilibria} are "
            "needed.",
            hint="Allow them more acceleration, expect less --damping, or ask for fewer equilibria.",
        )
    return pool.tabled(mechanism, task, np.array(found))


def reached(some: Some) -> list[Float[np.ndarray, " z"]]:
    """Those of a few windows that winches can excite, displaced by as much."""
    task, found = some.task, list[np.ndarray]()
    if task.winches is None:
        raise OurBugError("Design: no winches to look at.")
    mechanism, n = task.mechanism(), task.robot.n
    for z in some.z:
        place = ExcitationPlace.at(mechanism, z[:n])
        wanted = wanted_amplitudes(place, z[n:])
        ones, damping = np.ones(len(wanted)), task.winches.damping
        # as at a second try: the first one shows how much is damped
        damped = Knowledge(damping * ones, ones, ones, SURE * damping * ones)
        try:
            plan = planned(place, wanted, damped, task.winches.limits, Bodies.around(place.body).others)
        except InfeasibleError:
            continue
        share = min(1.0, float(np.linalg.norm(plan.reached) / np.linalg.norm(wanted)))
        found.append(np.concatenate([z[:n], CERTAIN * share * z[n:]]))
    return found
