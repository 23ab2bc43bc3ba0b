"""The robot's own sensors beside the encoders, as the further columns of a window hold them.

    s1 … sn                   swivel angles of the pulleys, rad (σ of spec/model.md §1, each with a constant of its own)
    incl_x, incl_y[, incl_z]  inclinometer or IMU on the platform: rotations about the world's x, then y, then z, rad
    rate_x, rate_y, rate_z    gyroscope on the platform: angular rate about the body's axes, rad/s, with its bias

`own_sensors` finds the first two; what they mean for the pose is in `identification.motion.pose_sources`. A gyroscope
shows no pose: `angular_rates` of windows without markers are fitted as they are (`identification.mle.by_rates`).
"""

from dataclasses import dataclass

import numpy as np

from fidim_lab.arrays import CableSeries
from fidim_lab.data.records import Window
from fidim_lab.errors import SetupError


@dataclass(frozen=True, eq=False)
class OwnSensors:
    """What one window's own sensors read, at the window's times; NaN where a reading is missing."""

    lengths: CableSeries
    """(N, n) from the encoders, m"""
    swivels: CableSeries
    """(N, n) rad"""
    inclination: np.ndarray
    """(N, K) rad about x, y (K = 2) and z (K = 3); K = 0 where there is none"""


def own_sensors(window: Window, cables: int) -> OwnSensors:
    """The readings of one window of a robot with so many cables.

    Raises SetupError, naming window and columns, where swivel angles or lengths are missing, or where fewer than six
    readings a sample leave the pose open.
    """
    swivels = swivel_angles(window, cables)
    if swivels is None:
        missing = [name for name in swivel_names(cables) if name not in window.further]
        raise SetupError(
            f"Window {window.id} has no column {', '.join(missing)}: the pose cannot be had from swivel angles.",
            hint="Record the swivel encoders (s1…sn, rad), or take the pose from the motion capture.",
        )
    if window.lengths is None:
        raise SetupError(
            f"Window {window.id} has no cable lengths (l1…ln), which are needed in addition to swivel angles."
        )
    axes = [f"incl_{axis}" for axis in "xyz" if f"incl_{axis}" in window.further]
    if axes not in ([], ["incl_x", "incl_y"], ["incl_x", "incl_y", "incl_z"]):
        raise SetupError(
            f"Window {window.id} has {', '.join(axes)} alone: an inclination is incl_x and incl_y, or these and incl_z."
        )
    if 2 * cables + len(axes) < 6:
        raise SetupError(
            f"Window {window.id}: {2 * cables + len(axes)} readings a sample ({cables} lengths, {cables} swivel "
            f"angles, {len(axes)} inclinations) leave the pose open; six are needed.",
            hint="Add an inclinometer (incl_x, incl_y) or an IMU with yaw (incl_z).",
        )
    inclination = np.column_stack([window.further[name] for name in axes]) if axes else np.empty((len(window.t), 0))
    return OwnSensors(window.lengths, swivels, inclination)


def swivel_names(cables: int) -> list[str]:
    """Columns of the swivels' encoders."""
    return [f"s{cable}" for cable in range(1, cables + 1)]


def swivel_angles(window: Window, cables: int) -> CableSeries | None:
    """(N, n) rad, each with a constant of its own; None where not every cable has its column."""
    names = swivel_names(cables)
    if not all(name in window.further for name in names):
        return None
    return np.column_stack([window.further[name] for name in names])


RATES = ("rate_x", "rate_y", "rate_z")
"""columns of a gyroscope"""


def has_rates_alone(window: Window) -> bool:
    """Whether a gyroscope is all that shows the motion."""
    return all(name in window.further for name in RATES) and not np.isfinite(window.markers).any()


def angular_rates(window: Window) -> np.ndarray:
    """(N, 3) rad/s of the window's gyroscope, whole samples or NaN; all NaN where it has none."""
    if not all(name in window.further for name in RATES):
        return np.full((len(window.t), 3), np.nan)
    found = np.column_stack([window.further[name] for name in RATES])
    return np.where(np.isfinite(found).all(axis=1, keepdims=True), found, np.nan)
