"""The places of cameras and markers against the robot, as unknowns of a trajectory fit (spec/irma4u.md §6.6).

A registration made before the fit (`registration.register`) takes cables for rigid; what it is off by, the body would
carry. So both frames are free in the fit: that of the cameras and that of the rigid set of markers. Anchors and
attachments stay fixed: they are the gauge.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca
import numpy as np

from fidim_lab.data.records import Robot, Window
from fidim_lab.effects.effect import NamedEffect, Parameter, vector
from fidim_lab.effects.geometry.frames import FrameMisalignment
from fidim_lab.identification.motion import rigid
from fidim_lab.model.geometry import rotation_from_gibbs

REGISTERED = 5e-3
"""m and rad, to which a registration by rigid cables is trusted"""


@dataclass(frozen=True)
class MarkerSet(NamedEffect):
    """All markers turned together by (rx, ry, rz) about P, then shifted by (dx, dy, dz), body frame.

    Of one platform's own calibration; no hypothesis of the catalogue, for it cannot be told from attachments.
    """

    id: ClassVar[str] = "marker-set"
    says: ClassVar[str] = "all markers sit turned by (rx, ry, rz) about P, then shifted by (dx, dy, dz)"
    source: ClassVar[str] = "spec/irma4u.md §6.6"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        *vector("r", "rad", "turned about", scale=1e-3, most=0.2),
        *vector("d", "m", "shift", scale=5e-4, most=0.2),
    )

    def marker(self, number: int, place: ca.SX, theta: ca.SX) -> ca.SX:
        """Turned and shifted."""
        return rotation_from_gibbs(theta[:3] / 2) @ place + theta[3:]


def free_frames(robot: Robot, windows: Sequence[Window]) -> tuple[NamedEffect, ...]:
    """Both frames where the markers span a frame in every window; none where they do not."""
    least = min((window.markers.shape[1] for window in windows), default=0)
    seen = np.asarray(robot.markers[:least])
    if least < 3 or rigid.spread(seen) <= rigid.MIN_SPREAD:
        return ()
    return FrameMisalignment(), MarkerSet()
