"""A marker that is elsewhere than the robot file says, or on a flexible stalk: it lags, swings and sags."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca
import numpy as np

from fidim_lab.effects.effect import NamedEffect, Parameter, vector
from fidim_lab.effects.plausibility import Context, Limit
from fidim_lab.model.slots import Stalk


@dataclass(frozen=True)
class MarkerOffset(NamedEffect):
    """Marker + (dx, dy, dz), body frame; of one marker, the main one unless said otherwise."""

    id: ClassVar[str] = "marker-offset"
    says: ClassVar[str] = "a marker elsewhere on the platform, m + (dx, dy, dz), body frame"
    source: ClassVar[str] = "spec/model.md §5"
    parameters: ClassVar[tuple[Parameter, ...]] = vector("d", "m", "true minus stated place", scale=5e-4, most=0.1)

    number: int = 1
    """1-based, the main marker first"""

    @property
    def label(self) -> str:
        """With the marker's number where it is not the main one."""
        return self.id if self.number == 1 else f"{self.id} (marker {self.number})"

    def marker(self, number: int, place: ca.SX, theta: ca.SX) -> ca.SX:
        """The moved place."""
        return place + theta if number == self.number else place


LARGEST_SAG = 0.02
"""m: a marker that sags more under its own weight when its stalk lies level is seen to hang"""
GRAVITY = 9.81
"""m/s²"""
STIFFEST = 1 / (2 * np.pi * 40.0) ** 2
"""s²: what swings faster than that (Hz) has died, or is no more than noise, when cameras of 100 Hz look"""


def _lean(name: str, after: str) -> Parameter:
    says = f"how far the stalk leans towards {after} of the axis it stands along, of x y z x y"
    return Parameter(name, "1", says, 0.1, low=-1.0, high=1.0, start=0.0, scan=(0.0,))


@dataclass(frozen=True)
class MarkerStalk(NamedEffect):
    """A small mass μ on a stalk along e that bends with the stiffness c across itself and does not get shorter.

    Its foot, where the robot file has the marker, moves with the platform, with acceleration a. As an oscillator in the
    room μ (ẍ − g) = c (foot − x) − damping; with y = (x − foot) c/μ, ω² = c/μ and k = 1/ω² (s²)

        ÿ + 2 ζ ω ẏ + ω² y = ω² (g − a),    seen at foot + R k (I − e eᵀ/‖e‖²) Rᵀ y,    e in the body frame

    (world frame, m/s²; slow motion: y = g − a). e is one axis of the body plus leans times the two others. It hangs at
    rest when a window begins; a part of a window that begins later begins without ringing. μ is too small to move the
    platform. Scored by its slow motion, fitted as it swings.

    A marker of 10 g on 0.3 m of 2 mm steel wire (c = 3 E I/L³ = 17 N/m) has ω/2π = 6.6 Hz, k = 6e-4 s²; one of 5 g on
    0.1 m of an M4 nylon screw (38 N/m) 14 Hz and 1.3e-4 s²: 0.1–0.6 mm for each m/s². ζ of plastic is 0.02–0.1.
    """

    id: ClassVar[str] = "marker-stalk"
    says: ClassVar[str] = "a marker on a flexible stalk along e: k = 1/(2π f)² for each m/s² across it, damping ζ"
    source: ClassVar[str] = "Newton; deflection of a cantilever, F L³/(3 E I)"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("k", "s²", "a stalk gives way to what pulls it", scale=2e-5, low=0.0, high=0.02, start=1e-4),
        Parameter("zeta", "1", "damping ratio", scale=0.05, low=0.0, high=1.0, start=0.1, scan=(0.1,)),
        _lean("lean1", "the next"),
        _lean("lean2", "the one after the next"),
    )

    number: int = 1
    """1-based, the main marker first"""

    axis: int = 2
    """0, 1, 2: x, y, z of the body, along which it stands but for its leans"""

    @property
    def label(self) -> str:
        """With its axis, and the marker's number where it is not the main one."""
        along = f"along {'xyz'[self.axis]}"
        return f"{self.id} ({along})" if self.number == 1 else f"{self.id} (marker {self.number}, {along})"

    def stalk(self, number: int, theta: ca.SX) -> Stalk | None:
        """k (I − e eᵀ/‖e‖²), ω = 1/√k, ζ."""
        if number != self.number:
            return None
        k, damping, along = theta[0], theta[1], ca.SX.zeros(3)
        for step, part in enumerate((ca.SX(1), theta[2], theta[3])):
            along[(self.axis + step) % 3] = part
        across = ca.SX.eye(3) - along @ along.T / ca.sumsqr(along)
        return Stalk(k * across, 1 / ca.sqrt(ca.fmax(k, STIFFEST)), damping)

    def limits(self, context: Context) -> Mapping[str, Limit]:
        """One that does not hang."""
        why = f"a marker that sags by {1e3 * LARGEST_SAG:.0f} mm under its own weight is seen to hang"
        return {"k": Limit(LARGEST_SAG / GRAVITY, why)}
