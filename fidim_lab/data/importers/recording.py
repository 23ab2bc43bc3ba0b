"""What every importer returns: a robot's geometry, marker trajectories and the robot's own log, not yet related.

Frozen values in SI units. Markers are in the motion capture's world frame and time base, the log in the robot's.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from fidim_lab.arrays import CableSeries, Matrix3, Positions, Rotations, Series, Vector3
from fidim_lab.data.records import Robot


@dataclass(frozen=True, eq=False)
class BodyTrack:
    """Poses of one rigid body, as the motion capture solved them."""

    name: str
    positions: Positions
    """(N, 3) motion-capture world frame, m; NaN where the body was not seen"""
    rotations: Rotations
    """(N, 3, 3) body → world"""
    read_as: str = ""
    """in which of several ways its rotations are read, where the file does not say it: other tracks have its name"""


@dataclass(frozen=True, eq=False)
class PlacedFrame:
    """A frame that stands still, in which the markers' own one is placed: they may be meant in it as well."""

    name: str
    rotation: Matrix3
    """markers' own frame → this one"""
    translation: Vector3
    """m"""

    def points(self, places: np.ndarray) -> np.ndarray:
        """(…, 3) m, in this frame."""
        return places @ self.rotation.T + self.translation


@dataclass(frozen=True, eq=False)
class MarkerLog:
    """Markers and rigid bodies of one take as the motion capture exported them."""

    source: Path
    names: tuple[str, ...]
    rate: float
    """Hz"""
    t: Series
    """s since the first frame"""
    positions: Float[np.ndarray, "N M 3"]
    """motion-capture world frame, m; NaN where a marker was not seen. M is 0 where only bodies were exported"""
    scale: float = 1e-3
    """metres in one unit of the file"""
    up: str | None = "z"
    """axis of the file that points upwards: "x", "y" or "z"; None where the file does not say"""
    decided: tuple[str, ...] = ()
    """what was decided while reading, a sentence each, for a person to check"""
    bodies: tuple[BodyTrack, ...] = ()
    unlabelled: Float[np.ndarray, "N K 3"] | None = None
    """places that were seen and given to no marker, m; NaN where there is none"""
    unit_said: bool = True
    """whether the file says its unit of length; otherwise positions are in that unit, as if it were m"""
    began: float | None = None
    """s since 1970 of the first frame, where the file says it"""
    frames: tuple[PlacedFrame, ...] = ()
    """still frames in which that of the markers is placed by the file"""
    rate_doubt: str = ""
    """why the rate has to be asked for, a sentence; empty where the file says one"""
    breaks: tuple[float, ...] = ()
    """s, between samples, where an unknown time passed, for the clock was set there: windows end"""


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
