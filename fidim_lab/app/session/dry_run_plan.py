"""What `fidim dry-run` is asked for, and the windows that it rehearses."""

from dataclasses import dataclass
from pathlib import Path

from fidim_lab.data.design_file import read_plan_or_design
from fidim_lab.data.records import Plan, Robot
from fidim_lab.identification.random_plan import WITHIN_LIMITS, random_plan


@dataclass(frozen=True)
class DryRunOptions:
    """As on the command line."""

    out: Path | None
    seed: int
    robot: Path | None
    equilibria: int
    validation: int
    hide: tuple[str, ...]
    real_time: bool
    json_file: Path | None
    ui: bool = False
    excite: bool = False
    """the winches excite, instead of a hand"""
    light: bool = False
    """the UI dark on light"""
    plan: Path | None = None
    """windows to rehearse, as they are; None: random ones"""


def planned(options: DryRunOptions, robot: Robot) -> Plan:
    """The plan that was given, or a random one. Raises FileError for a wrong one, InfeasibleError without any."""
    if options.plan is not None:
        return read_plan_or_design(options.plan, robot.n)
    return random_plan(robot, "dry run", options.equilibria, options.validation, options.seed, WITHIN_LIMITS)
