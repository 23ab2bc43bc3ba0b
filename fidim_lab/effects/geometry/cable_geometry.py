"""Pulleys, attachments and lengths of cables that are not as the robot file says."""

from dataclasses import dataclass, replace
from typing import ClassVar

import casadi as ca
import numpy as np

from fidim_lab.effects.effect import NamedEffect, Parameter, vector
from fidim_lab.effects.plausibility import Context
from fidim_lab.model.geometry import CableConstants, rotation_from_gibbs


@dataclass(frozen=True)
class AnchorOffset(NamedEffect):
    """d_i + (dx, dy, dz), world frame."""

    id: ClassVar[str] = "anchor-offset"
    says: ClassVar[str] = "pulley entry point elsewhere, d_i + (dx, dy, dz), world frame"
    source: ClassVar[str] = "spec/model.md §1, §5"
    parameters: ClassVar[tuple[Parameter, ...]] = vector(
        "d", "m", "true minus stated entry point", scale=1e-3, most=0.2
    )

    def geometry(self, number: int, cable: CableConstants, theta: ca.SX) -> CableConstants:
        """The moved entry point."""
        return replace(cable, d=cable.d + theta) if self.concerns(number) else cable


@dataclass(frozen=True)
class AttachmentOffset(NamedEffect):
    """a_i + (dx, dy, dz), body frame."""

    id: ClassVar[str] = "attachment-offset"
    says: ClassVar[str] = "attachment elsewhere, a_i + (dx, dy, dz), body frame"
    source: ClassVar[str] = "spec/model.md §1, §5"
    parameters: ClassVar[tuple[Parameter, ...]] = vector("d", "m", "true minus stated attachment", scale=1e-3, most=0.1)

    def geometry(self, number: int, cable: CableConstants, theta: ca.SX) -> CableConstants:
        """The moved attachment."""
        return replace(cable, a=cable.a + theta) if self.concerns(number) else cable


@dataclass(frozen=True)
class PulleyRadius(NamedEffect):
    """r + dr, alike for all cables or for one."""

    id: ClassVar[str] = "pulley-radius"
    says: ClassVar[str] = "pulleys of another radius, r + dr"
    source: ClassVar[str] = "spec/model.md §1, §5"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("dr", "m", "true minus stated radius", scale=5e-4, low=-0.05, high=0.05, start=0.0),
    )

    def geometry(self, number: int, cable: CableConstants, theta: ca.SX) -> CableConstants:
        """The other radius."""
        return replace(cable, radius=cable.radius + theta[0]) if self.concerns(number) else cable

    def bounds(self, context: Context | None = None) -> tuple[np.ndarray, np.ndarray]:
        """No radius becomes negative."""
        low, high = super().bounds(context)
        return (low, high) if context is None else (np.maximum(low, -self._least(context)), high)

    def plausible(self, values: np.ndarray, context: Context) -> str | None:
        """A radius is not negative."""
        if values[0] < -self._least(context):
            return (
                f"{self.label}: dr = {1e3 * values[0]:.2f} mm, but a pulley of {1e3 * self._least(context):.1f} mm "
                "would get a negative radius."
            )
        return super().plausible(values, context)

    def _least(self, context: Context) -> float:
        return min(radius for number, radius in enumerate(context.radii, start=1) if self.concerns(number))


@dataclass(frozen=True)
class SwivelAxis(NamedEffect):
    """The triad x, y, z of cable i turned by (rx, ry) about its own x and y; D stays."""

    id: ClassVar[str] = "swivel-axis"
    says: ClassVar[str] = "swivel axis elsewhere: z turned by (rx, ry) about the swivel's own x and y"
    source: ClassVar[str] = "geometry of Table 1"
    parameters: ClassVar[tuple[Parameter, ...]] = tuple(
        Parameter(f"r{axis}", "rad", f"turned about the swivel's {axis}", scale=5e-3, low=-0.2, high=0.2, start=0.0)
        for axis in "xy"
    )

    def geometry(self, number: int, cable: CableConstants, theta: ca.SX) -> CableConstants:
        """The turned triad."""
        if not self.concerns(number):
            return cable
        triad = ca.horzcat(cable.x, cable.y, cable.z)
        turned = triad @ rotation_from_gibbs(ca.vertcat(theta / 2, 0))
        return replace(cable, x=turned[:, 0], y=turned[:, 1], z=turned[:, 2])


@dataclass(frozen=True)
class CableLengthBias(NamedEffect):
    """The encoder reads the true length + bias."""

    id: ClassVar[str] = "cable-length-bias"
    says: ClassVar[str] = "encoder zero wrong: it reads the true length + bias"
    source: ClassVar[str] = "spec/model.md §5"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("bias", "m", "reading minus true length", scale=5e-4, low=-0.2, high=0.2, start=0.0),
    )

    def cable_length(self, number: int, theta: ca.SX) -> ca.SX:
        """The bias."""
        return theta[0] if self.concerns(number) else ca.SX(0)


@dataclass(frozen=True)
class CableCreep(NamedEffect):
    """l₀(t) = l₀ + δ (1 − e^(−t/T)), t since the start of the window.

    δ < 0 is a cable that recovers after a larger load. T has no score at δ = 0: it is scanned.
    """

    id: ClassVar[str] = "cable-creep"
    says: ClassVar[str] = "one cable creeps, l₀(t) = l₀ + δ (1 − e^(−t/T)), from the start of each window"
    source: ClassVar[str] = "Kelvin–Voigt; spec/model.md §5"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("delta", "m", "final creep", scale=1e-4, low=-0.05, high=0.05, start=1e-3),
        Parameter(
            "T", "s", "time constant", scale=1.0, low=0.1, high=100.0, start=4.0, scan=(0.5, 1.0, 2.0, 4.0, 8.0, 20.0)
        ),
    )

    def length_drift(self, number: int, time: ca.SX, theta: ca.SX) -> ca.SX:
        """δ (1 − e^(−t/T))."""
        return -theta[0] * ca.expm1(-time / theta[1]) if self.concerns(number) else ca.SX(0)
