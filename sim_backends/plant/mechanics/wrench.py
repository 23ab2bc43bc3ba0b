"""A wrench on the platform, and the type of what makes one."""

from collections.abc import Callable
from typing import NamedTuple

import casadi as ca

from sim_backends.plant.hidden import HiddenEffect
from sim_backends.plant.mechanics.kinematics import Platform


class Wrench(NamedTuple):
    """Force (N) and moment about G (N m), world frame."""

    force: ca.SX
    moment: ca.SX


Term = Callable[[Platform, HiddenEffect], Wrench]
