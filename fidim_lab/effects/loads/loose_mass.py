"""A mass on a spring and damper inside the platform: a loose part, a liquid."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca
import numpy as np

from fidim_lab.data.records import Robot
from fidim_lab.effects.effect import NamedEffect, Parameter
from fidim_lab.effects.plausibility import Context, Limit
from fidim_lab.effects.wrenches import at_arm
from fidim_lab.model.slots import ExtraState, PlatformState

LARGEST_SHARE = 0.5
"""of the platform's mass"""


@dataclass(frozen=True)
class LooseMass(NamedEffect):
    """A point mass m held at b (body frame) by an isotropic spring and damper, in addition to the platform's own mass.

    Its place q and velocity q̇ (world frame) are extra states: q̈ = ω² (H − q) + 2 ζ ω (Ḣ − q̇) + g with H = p + R b and
    ω = 2π f; the platform feels −m (q̈ − g) at H. It starts hanging at rest against the platform. f, ζ and b have no
    score at m = 0: they are scanned.
    """

    id: ClassVar[str] = "loose-mass"
    says: ClassVar[str] = "a mass m on a spring (f) and damper (ζ) at b inside the platform, in addition to its mass"
    source: ClassVar[str] = "Newton; spec/model.md §5"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("m", "kg", "a mass is positive", scale=0.02, low=0.0, high=100.0, start=0.1),
        Parameter(
            "f",
            "Hz",
            "frequency on the held platform",
            scale=0.2,
            low=0.2,
            high=15.0,
            start=2.5,
            scan=(0.6, 0.8, 1.0, 1.25, 1.5, 1.8, 2.1, 2.4, 2.8, 3.2, 3.8, 4.5, 6.0),
        ),
        Parameter("zeta", "1", "damping ratio", scale=0.05, low=0.0, high=1.0, start=0.05, scan=(0.05,)),
        Parameter("bx", "m", "where it is held, body frame", scale=0.05, low=-0.5, high=0.5, start=0.0, scan=(0.0,)),
        Parameter("by", "m", "where it is held, body frame", scale=0.05, low=-0.5, high=0.5, start=0.0, scan=(0.0,)),
        Parameter("bz", "m", "where it is held, body frame", scale=0.05, low=-0.5, high=0.5, start=0.1, scan=(0.1,)),
    )
    extra_states: ClassVar[tuple[ExtraState, ...]] = (
        *(ExtraState(f"q{axis}", "m", spread=0.01) for axis in "xyz"),
        *(ExtraState(f"q̇{axis}", "m/s", spread=0.05) for axis in "xyz"),
    )

    def wrench(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """−m (q̈ − g) at H."""
        return at_arm(state.rotation @ theta[3:], -theta[0] * _pull(state, theta))

    def extra_start(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """Hanging from H as its weight pulls it, without a velocity of its own."""
        arm = state.rotation @ theta[3:]
        sag = state.gravity / _pulsation(theta) ** 2
        return ca.vertcat(state.position + arm + sag, state.velocity(arm))

    def extra_rates(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """[q̇; q̈]."""
        return ca.vertcat(state.extra[3:], _pull(state, theta) + state.gravity)

    def wider(self, values: np.ndarray, robot: Robot) -> tuple[tuple[NamedEffect, np.ndarray], ...]:
        """Sliding along one of the body's axes."""
        return tuple((LooseMassOnAxis(), np.concatenate([values, axis])) for axis in np.eye(3)) if values[0] > 0 else ()

    def limits(self, context: Context) -> Mapping[str, Limit]:
        """A part of the platform."""
        return {"m": _share(context)}


@dataclass(frozen=True)
class LooseMassOnAxis(NamedEffect):
    """A point mass m that slides along an axis e through b, on a spring and damper: a drawer, a battery in its bay.

    Its displacement s and its own velocity w along the axis are extra states: ṡ = w − e·v_H, ẇ = g·e − ω² s − 2 ζ ω ṡ.
    Across the axis it is a part of the body: kinetic energy ½ m ‖v_H − e (e·v_H)‖². Lagrange's equations with w as the
    momentum of s (Routh) give the rest; s is small against b and against the platform.
    """

    id: ClassVar[str] = "loose-mass"
    variant: ClassVar[str] = "along an axis"
    says: ClassVar[str] = (
        "a mass m that slides along an axis e through b of the platform, on a spring (f) and damper (ζ)"
    )
    source: ClassVar[str] = "Routh's equations; spec/model.md §5"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        *LooseMass.parameters,
        Parameter("ex", "1", "axis, body frame, of any length", scale=0.1, low=-2.0, high=2.0, start=0.0, scan=(0.0,)),
        Parameter("ey", "1", "axis, body frame, of any length", scale=0.1, low=-2.0, high=2.0, start=0.0, scan=(0.0,)),
        Parameter("ez", "1", "axis, body frame, of any length", scale=0.1, low=-2.0, high=2.0, start=1.0, scan=(1.0,)),
    )
    extra_states: ClassVar[tuple[ExtraState, ...]] = (
        ExtraState("s", "m", spread=0.01),
        ExtraState("w", "m/s", spread=0.05),
    )

    def wrench(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """Weight, and what spring, damper and the turning axis give."""
        mass, arm, axis, (s, w) = theta[0], state.rotation @ theta[3:6], _axis(state, theta), ca.vertsplit(state.extra)
        along = self.extra_rates(state, theta)[1] * axis + w * ca.cross(state.spin, axis)
        # of the momentum w along a turning axis: gradient of w e·v_H at fixed twist
        turning = w * state.gradient(ca.dot(axis, state.velocity(arm)))
        force = mass * (state.gravity - along)
        torque = ca.cross(arm, mass * (state.gravity - self.extra_rates(state, theta)[1] * axis))
        torque += ca.cross(s * axis, mass * state.gravity)
        return ca.vertcat(force, torque) + mass * turning

    def kinetic_energy(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """Across the axis."""
        velocity, axis = state.velocity(state.rotation @ theta[3:6]), _axis(state, theta)
        return theta[0] / 2 * (ca.sumsqr(velocity) - ca.dot(axis, velocity) ** 2)

    def extra_start(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """Hanging as its weight pulls it, without a velocity of its own."""
        axis = _axis(state, theta)
        velocity = state.velocity(state.rotation @ theta[3:6])
        return ca.vertcat(ca.dot(axis, state.gravity) / _pulsation(theta) ** 2, ca.dot(axis, velocity))

    def extra_rates(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """[ṡ; ẇ]."""
        axis, pulsation = _axis(state, theta), _pulsation(theta)
        rate = state.extra[1] - ca.dot(axis, state.velocity(state.rotation @ theta[3:6]))
        pulled = pulsation**2 * state.extra[0] + 2 * theta[2] * pulsation * rate
        return ca.vertcat(rate, ca.dot(axis, state.gravity) - pulled)

    def limits(self, context: Context) -> Mapping[str, Limit]:
        """A part of the platform."""
        return {"m": _share(context)}


def _share(context: Context) -> Limit:
    why = f"that is over half of the platform's {context.mass:.1f} kg"
    return Limit(LARGEST_SHARE * context.mass, why)


def _axis(state: PlatformState, theta: ca.SX) -> ca.SX:
    """Unit vector, world frame."""
    return state.rotation @ theta[6:9] / ca.norm_2(theta[6:9])


def _pulsation(theta: ca.SX) -> ca.SX:
    return 2 * np.pi * theta[1]


def _pull(state: PlatformState, theta: ca.SX) -> ca.SX:
    """What spring and damper give the mass (3), m/s²."""
    arm, w = state.rotation @ theta[3:], _pulsation(theta)
    away = state.position + arm - state.extra[:3]
    return w**2 * away + 2 * theta[2] * w * (state.velocity(arm) - state.extra[3:])
