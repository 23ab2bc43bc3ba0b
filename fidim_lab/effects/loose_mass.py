"""A mass on a spring and damper inside the platform: a loose part, a liquid."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca
import numpy as np

from fidim_lab.effects.effect import NamedEffect, Parameter
from fidim_lab.effects.forces import at_arm
from fidim_lab.effects.plausibility import Context, Limit
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
    source: ClassVar[str] = "Newton; MODEL.md §5"
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

    def limits(self, context: Context) -> Mapping[str, Limit]:
        """A part of the platform."""
        why = f"that is over half of the platform's {context.mass:.1f} kg"
        return {"m": Limit(LARGEST_SHARE * context.mass, why)}


def _pulsation(theta: ca.SX) -> ca.SX:
    return 2 * np.pi * theta[1]


def _pull(state: PlatformState, theta: ca.SX) -> ca.SX:
    """What spring and damper give the mass (3), m/s²."""
    arm, w = state.rotation @ theta[3:], _pulsation(theta)
    away = state.position + arm - state.extra[:3]
    return w**2 * away + 2 * theta[2] * w * (state.velocity(arm) - state.extra[3:])
