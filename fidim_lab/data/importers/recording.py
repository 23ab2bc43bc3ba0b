"""What every importer returns: a robot's geometry, marker trajectories and the robot's own log, not yet related.

Frozen values in SI units. Markers are in the motion capture's world frame and time base, the log in the robot's.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from fidim_lab.arrays import CableSeries, Positions, Series
from fidim_lab.data.records import Robot


@dataclass(frozen=True, eq=False)
class MarkerLog:
    """Trajectories of the platform's markers as the motion capture exported them."""

    source: Path
    names: tuple[str, ...]
    rate: float
    """Hz"""
    t: Series
    """s since the first frame"""
    positions: Float[np.ndarray, "N M 3"]
    """motion-capture world frame, m; NaN where a marker was not seen"""
    scale: float = 1e-3
    """metres in one unit of the file"""
    up: str = "z"
    """axis of the file that points upwards: "y" or "z\""""
    decided: tuple[str, ...] = ()
    """what was decided while reading, a sentence each, for a person to check"""


@dataclass(frozen=True, eq=False)
class RobotLog:
    """What the robot's controller logged, in its own time base."""

    source: Path
    t: Series
    """s, increasing; the robot's clock"""
    lengths: CableSeries
    """(K, n) cable lengths from the encoders, m, each with an unknown constant"""
    swivels: CableSeries
    """(K, n) swivel angles, rad, each with an unknown constant"""
    tensions: CableSeries
    """(K, n) load cells, N"""
    inclinometer: Positions
    """(K, 3) rotations about the platform's x, y, z, rad, each with an unknown constant"""


@dataclass(frozen=True, eq=False)
class Recording:
    """One continuous recording with the robot it was made on."""

    kind: str
    name: str
    robot: Robot
    """geometry and nominal body; `marker` is a placeholder, for nobody measured the markers in the body frame"""
    geometry_source: Path
    markers: MarkerLog
    log: RobotLog
