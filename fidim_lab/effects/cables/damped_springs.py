"""Springs in the cables' way, each with a damper beside it: what `explain` looks for, and fits.

Forms of one thing, which the platform feels nearly alike: a cable that stretches with its length, one that does so
whatever its length, a winch that yields where its encoder sees it, and posts that bend sideways.
"""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca
import numpy as np

from fidim_lab.effects.cables.cable_elasticity import DAMPING, CableElasticity, CableStiffness
from fidim_lab.effects.cables.frame_compliance import FrameCompliance
from fidim_lab.effects.cables.winch_hold_compliance import WinchHoldCompliance
from fidim_lab.effects.effect import NamedEffect, Parameter
from fidim_lab.effects.plausibility import Context

DAMPER = Parameter(
    "damping", "N s/m", "a damping is positive", scale=5.0, low=0.5, high=2e3, start=DAMPING, scan=(DAMPING,)
)
"""of a cable's stretch, or of a winch's yielding: beside a motion of tens of newtons ten times a second it takes a
thousandth of the energy in 10 s, which moves the markers by their noise. It has no score where nothing stretches"""
Forms = tuple[tuple[NamedEffect, np.ndarray], ...]


@dataclass(frozen=True)
class _Damped(NamedEffect):
    """A spring whose last θ is that of its damper: the same for every cable that it concerns."""

    def stretch_damping(self, number: int, theta: ca.SX) -> ca.SX:
        """N s/m."""
        return theta[-1] if self.concerns(number) else ca.SX(0)


@dataclass(frozen=True)
class DampedElasticity(_Damped, CableElasticity):
    """l = l₀ + ρ τ/EA."""

    parameters: ClassVar[tuple[Parameter, ...]] = (*CableElasticity.parameters, DAMPER)

    def other_forms(self, values: np.ndarray, context: Context) -> Forms:
        """The same compliance at the usual length, whatever the length, or of the cable's winch."""
        return _others(self, values * (context.free_length, 1.0), context)


@dataclass(frozen=True)
class DampedStiffness(_Damped, CableStiffness):
    """l = l₀ + τ/k."""

    parameters: ClassVar[tuple[Parameter, ...]] = (*CableStiffness.parameters, DAMPER)

    def other_forms(self, values: np.ndarray, context: Context) -> Forms:
        """The same compliance at the usual length, going with the length, or of the cable's winch."""
        return _others(self, values, context)


@dataclass(frozen=True)
class DampedWinch(_Damped, WinchHoldCompliance):
    """l = l₀ + τ/k at one winch."""

    parameters: ClassVar[tuple[Parameter, ...]] = (*WinchHoldCompliance.parameters, DAMPER)

    def other_forms(self, values: np.ndarray, context: Context) -> Forms:
        """The same compliance of the cable, which the encoder does not see."""
        return _others(self, values, context)


@dataclass(frozen=True)
class DampedFrame(_Damped, FrameCompliance):
    """δ = τ (tx, ty, 0)/k at every entry point."""

    parameters: ClassVar[tuple[Parameter, ...]] = (*FrameCompliance.parameters, DAMPER)

    def other_forms(self, values: np.ndarray, context: Context) -> Forms:
        """The same compliance of the cables."""
        return _others(self, values * (context.level, 1.0), context)


def _others(form: NamedEffect, values: np.ndarray, context: Context) -> Forms:
    """The forms besides this one, of the same 1/k (m/N) and damping; all winches do not yield alike."""
    cable = form.cable
    forms: list[tuple[NamedEffect, np.ndarray]] = [
        (DampedElasticity(cable), values / (context.free_length, 1.0)),
        (DampedStiffness(cable), values),
    ]
    forms.append((DampedFrame(), values / (context.level, 1.0)) if cable is None else (DampedWinch(cable), values))
    return tuple((other, theta) for other, theta in forms if other != form)
