"""Motion of the completed model in time: its equations, free and driven, on rigid cables and on springs.

In: a Mechanism, a Body, a pose and twist, times (s), lengths (m). Out: motion and tensions at those times.
"""

from fidim_lab.model.motion.contributions import extra_count
from fidim_lab.model.motion.driven import driven_derivative, driven_motions
from fidim_lab.model.motion.dynamics import FreeMotion, consistent_twist, simulate_free_motion
from fidim_lab.model.motion.free_motion import (
    AXIS_NAMES,
    best_axes,
    conditioning,
    free_twist_basis,
    marker_selector,
    motion_from_free,
)

__all__ = [
    "AXIS_NAMES",
    "FreeMotion",
    "best_axes",
    "conditioning",
    "consistent_twist",
    "driven_derivative",
    "driven_motions",
    "extra_count",
    "free_twist_basis",
    "marker_selector",
    "motion_from_free",
    "simulate_free_motion",
]
