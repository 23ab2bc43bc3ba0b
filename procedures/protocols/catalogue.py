"""The procedures by name, and those of a laboratory's own: `experiment` makes a checked one.

A Python file is a procedure when it has a generator function `procedure(lab)`: docs/procedures.md shows one.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

from fidim_lab.data.records import Plan, Robot, Role
from fidim_lab.errors import SetupError
from procedures.expected.limits import Statics
from procedures.protocols.commission import commission
from procedures.protocols.compare import compare, compare_by_winches
from procedures.protocols.experiment import Experiment, Lab, Make, checked_experiment
from procedures.protocols.home import home
from procedures.protocols.identify import identify
from procedures.protocols.own import own_procedure
from procedures.protocols.take_up import take_up
from procedures.protocols.tension_check import tension_check
from procedures.recording.resumption import Resumption
from procedures.settings import Settings
from procedures.steps import Steps

CROSS_VALIDATION = 22
"""windows of the paper's Fig. 3"""


def _excite(lab: Lab) -> Steps:
    from procedures.protocols.excite import excite  # scipy's optimizers: nobody else waits for them

    return excite(lab)


def _align(lab: Lab) -> Steps:
    from procedures.protocols.align import align  # scipy, as above

    return align(lab)


@dataclass(frozen=True)
class Listed:
    """One procedure."""

    says: str
    make: Make
    role: Role | None = None
    """that all its windows get, whatever the plan says"""
    adds: bool = False
    """windows to those of the plan"""
    alone: bool = False
    """never asks anybody anything"""
    needs: tuple[Role, ...] = ()
    """roles of which the plan must have a window"""


CATALOGUE: Mapping[str, Listed] = MappingProxyType(
    {
        "identify": Listed("free motion about each equilibrium of the plan, recorded and judged", identify),
        "excite": Listed("the same without a hand: the winches excite, calm and travel gently", _excite, alone=True),
        "cross-validate": Listed(
            f"the same, for windows that are not used in any fit (the paper has {CROSS_VALIDATION})",
            identify,
            Role.VALIDATE,
        ),
        "payload-mass": Listed(
            "the same with a known payload mounted: identify EMPTY --payload THIS finds the mass",
            identify,
            Role.IDENTIFY,
        ),
        "home": Listed("the encoders' zeros, at a known or measured pose, without power", home),
        "take-up": Listed("slack taken up by torque, cable by cable, with the platform fixed; brakes hold it", take_up),
        "commission": Listed("every stop of every winch, proven by trial without load (fidim commission)", commission),
        "align": Listed("delay of motion capture against the encoders, by a move up and down", _align, alone=True),
        "compare": Listed(
            "record the plan, explain it, record the most informative windows: until the verdict is clear",
            compare,
            adds=True,
            needs=(Role.IDENTIFY, Role.VALIDATE),
        ),
        "compare-by-winches": Listed(
            "compare without a hand, excited as by excite",
            compare_by_winches,
            adds=True,
            alone=True,
            needs=(Role.IDENTIFY, Role.VALIDATE),
        ),
        "tension-check": Listed("every tension at rest at each equilibrium against its limits", tension_check),
    }
)


def experiment(
    name: str,
    plan: Plan,
    robot: Robot,
    settings: Settings | None = None,
    *,
    statics: Statics | None = None,
    resumption: Resumption | None = None,
) -> Experiment:
    """A procedure of the catalogue, or of a Python file, for a plan; its limits checked (some seconds).

    Raises SetupError for an unknown name, a file that is no procedure, or a plan without windows of a role that it
    needs, InfeasibleError where it leaves the limits.
    """
    entry = _entry(name)
    for role in entry.needs:
        if all(window.role is not role for window in plan.windows):
            raise SetupError(
                f"The plan {plan.name} has no window of the role {role.value}, which {name} needs: the result "
                "of some windows is tested on others.",
                hint=f'Write role = "{role.value}" for every third or fourth window.',
            )
    if entry.role is not None:
        plan = replace(plan, windows=tuple(replace(window, role=entry.role) for window in plan.windows))
    if resumption is not None:
        resumption = replace(resumption, goes_on=entry.adds)
    own = Path(name) if name.endswith(".py") else None
    return checked_experiment(entry.make, plan, robot, settings, statics, resumption, own)


def never_asks(name: str) -> bool:
    """Whether a procedure needs nobody to answer a prompt. Raises SetupError for an unknown name."""
    return _entry(name).alone


def _entry(name: str) -> Listed:
    if name.endswith(".py"):
        return Listed("a procedure of your own", own_procedure(Path(name)))
    if name not in CATALOGUE:
        known = ", ".join(CATALOGUE)
        raise SetupError(f"Procedure {name!r}: no procedure has this name. Give one of {known}, or a Python file.")
    return CATALOGUE[name]
