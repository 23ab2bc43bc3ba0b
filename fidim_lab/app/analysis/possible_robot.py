"""Is the robot file to blame? The checks of `fidim doctor --robot`, before a design, a simulation or a dry run.

Limits protect the machine: nobody is told to widen them for a marker in millimetres or a mass in grams.
"""

from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from fidim_lab.app.doctor.robot_plausibility import (
    RobotFinding,
    attachments,
    body,
    inertia,
    middle_rests,
    plausibility,
    rest,
    units,
    weight,
)
from fidim_lab.app.terminal import console
from fidim_lab.data.records import Robot
from fidim_lab.errors import FileError, InfeasibleError
from fidim_lab.model.mechanism import Mechanism

IMPOSSIBLE = (units, body, weight)
"""no design, simulation or run of a robot that fails one of these means anything"""
UNUSUAL = (attachments, inertia)
"""such a robot may exist, but more often it is a mistake"""


def require_possible(path: Path, robot: Robot) -> None:
    """Warn of what is unusual, as where it cannot rest.

    Raises FileError for wrong units, a body that cannot exist or that cannot be carried.
    """
    for check in IMPOSSIBLE:
        finding = check(robot)
        if not finding.ok:
            raise FileError(path, finding.what, finding.found, hint=finding.advice)
    found = [check(robot) for check in UNUSUAL]
    if robot.n > 2:  # with fewer the middle is no place to rest
        found.append(rest(robot, middle_rests(Mechanism(robot))))
    console.warn([f"{path}: {one.what}: {one.found} {one.advice}" for one in found if not one.ok])


@contextmanager
def doubting(path: Path, robot: Robot) -> Generator[None]:
    """Say what is doubtful about the robot file where no design is found.

    Raises InfeasibleError as what is done in it, with that as its hint.
    """
    try:
        yield
    except InfeasibleError as refusal:
        doubts = [finding for finding in plausibility(robot) if not finding.ok]
        raise InfeasibleError(refusal.message, hint=_hint(path, doubts) or refusal.hint) from refusal


def _hint(path: Path, doubts: list[RobotFinding]) -> str:
    if not doubts:
        return ""
    said = " ".join(f"{finding.what}: {finding.found} {finding.advice}" for finding in doubts)
    return f"Check the robot file {path} first (units, geometry, body), before its limits are changed. {said}"
