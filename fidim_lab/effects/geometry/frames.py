"""The frame, scale and clock of the motion capture, and the direction of gravity, against those of the robot."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from fidim_lab.effects.effect import NamedEffect, Parameter, vector
from fidim_lab.effects.wrenches import at_centre
from fidim_lab.model.geometry import rotation_from_gibbs
from fidim_lab.model.slots import PlatformState


@dataclass(frozen=True)
class FrameMisalignment(NamedEffect):
    """Measured = turned by (rx, ry, rz) about the robot frame's origin, then shifted by (dx, dy, dz).

    Turned by the Gibbs vector of half the angles, as `gravity_tilt`.
    """

    id: ClassVar[str] = "frame-misalignment"
    says: ClassVar[str] = "motion capture reports points rotated by (rx, ry, rz), then shifted by (dx, dy, dz)"
    source: ClassVar[str] = "spec/model.md §5"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        *vector("r", "rad", "turned about", scale=1e-3, most=0.2),
        *vector("d", "m", "shift", scale=5e-4, most=0.2),
    )

    def seen(self, point: ca.SX, state: PlatformState, theta: ca.SX) -> ca.SX:
        """Turned and shifted."""
        return rotation_from_gibbs(theta[:3] / 2) @ point + theta[3:]


@dataclass(frozen=True)
class GravityTilt(NamedEffect):
    """Gravity turned by the rotation vector (rx, ry, 0); its size stays.

    Turned by the Gibbs vector of half the angles, which differs from the rotation vector by a twelfth of its third
    power (10⁻⁷ at 10 mrad).
    """

    id: ClassVar[str] = "gravity-tilt"
    says: ClassVar[str] = "gravity turned by (rx, ry, 0) against the robot's frame"
    source: ClassVar[str] = "spec/model.md §5"
    parameters: ClassVar[tuple[Parameter, ...]] = tuple(
        Parameter(f"r{axis}", "rad", f"turned about {axis}", scale=1e-3, low=-0.2, high=0.2, start=0.0) for axis in "xy"
    )

    def wrench(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """The change of the weight, at G."""
        turn = rotation_from_gibbs(ca.vertcat(theta / 2, 0))
        return at_centre(state, state.mass * (turn @ state.gravity - state.gravity))


@dataclass(frozen=True)
class CaptureScale(NamedEffect):
    """Measured = (1 + scale) times the true place, from the robot frame's origin.

    Scaled about another point the measured places are shifted, too (`frame-misalignment`).
    """

    id: ClassVar[str] = "capture-scale"
    says: ClassVar[str] = "motion capture measures (1 + scale) times the true lengths"
    source: ClassVar[str] = "spec/model.md §5"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("scale", "1", "measured too long by this ratio", scale=1e-3, low=-0.05, high=0.05, start=0.0),
    )

    def seen(self, point: ca.SX, state: PlatformState, theta: ca.SX) -> ca.SX:
        """(1 + scale) p."""
        return (1 + theta[0]) * point


@dataclass(frozen=True)
class ClockRate(NamedEffect):
    """A frame stamped t was taken at t/(1 + rate)."""

    id: ClassVar[str] = "clock-rate"
    says: ClassVar[str] = "the cameras' clock runs fast: a frame stamped t was taken at t/(1 + rate)"
    source: ClassVar[str] = "spec/model.md §5"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("rate", "1", "clock too fast by this ratio", scale=1e-4, low=-0.05, high=0.05, start=0.0),
    )

    def true_time(self, stamp: ca.SX, theta: ca.SX) -> ca.SX:
        """t/(1 + rate)."""
        return stamp / (1 + theta[0])


@dataclass(frozen=True)
class TimeOffset(NamedEffect):
    """A frame stamped t was taken at t + offset."""

    id: ClassVar[str] = "time-offset"
    says: ClassVar[str] = "stamps are early: a frame stamped t was taken at t + offset"
    source: ClassVar[str] = "spec/model.md §5"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("offset", "s", "taken later than stamped", scale=1e-3, low=-0.5, high=0.5, start=0.0),
    )

    def true_time(self, stamp: ca.SX, theta: ca.SX) -> ca.SX:
        """t + offset."""
        return stamp + theta[0]
