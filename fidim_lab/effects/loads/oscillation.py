"""sin and cos of one frequency with free amplitudes: what a periodic force and a swaying frame have in common.

The amplitudes of sin and cos are linear parameters, so that a score exists at 0; the frequency has none there and is
scanned. A recording has no absolute time, only that since the start of each window:
- *same phase*: every window begins at the same phase (triggered, or whole periods between the windows);
- *own phase*: every window begins at a phase φ of its own, an extra state with φ̇ = 0 that counts as part of the
  window's start; amplitudes and frequency are shared. φ has no score at amplitude 0: there the amplitudes of every
  window stand for it (`of_each_window`).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca
import numpy as np

from fidim_lab.effects.effect import NamedEffect, Parameter
from fidim_lab.effects.loads.constant_force import share_of_weight
from fidim_lab.effects.plausibility import Context, Limit
from fidim_lab.effects.wrenches import at_centre
from fidim_lab.model.slots import ExtraState, PlatformState

SCAN = 0.1
"""Hz from one frequency of the scan to the next: 10 s of recording tell them apart"""
FREQUENCIES = tuple(float(f) for f in np.round(np.arange(0.2, 10.05, SCAN), 3))
"""Hz"""

PHASE = ExtraState("phase", "rad", spread=np.inf, tries=(0.0, 0.5 * np.pi, np.pi, -0.5 * np.pi))


def oscillation_parameters(unit: str, says: str, *, scale: float, most: float) -> tuple[Parameter, ...]:
    """Amplitudes sx sy sz of sin, cx cy cz of cos, and f."""
    amplitudes = tuple(
        Parameter(f"{part}{axis}", unit, f"{says}, {axis}, of {wave}", scale=scale, low=-most, high=most, start=0.0)
        for part, wave in (("s", "sin"), ("c", "cos"))
        for axis in "xyz"
    )
    frequency = Parameter("f", "Hz", "frequency", scale=0.1, low=0.05, high=20.0, start=1.0, scan=FREQUENCIES)
    return (*amplitudes, frequency)


def oscillation(time: ca.SX, extra: ca.SX, theta: ca.SX) -> ca.SX:
    """s sin(2π f t + φ) + c cos(2π f t + φ) (3); φ is the extra state, or 0 where there is none."""
    phase = 2 * np.pi * theta[6] * time + (extra[0] if extra.numel() else 0)
    return theta[:3] * ca.sin(phase) + theta[3:6] * ca.cos(phase)


@dataclass(frozen=True)
class PeriodicForce(NamedEffect):
    """F = s sin(2π f t) + c cos(2π f t) at G, t since the start of the window: the same phase in every window."""

    id: ClassVar[str] = "periodic-force"
    variant: ClassVar[str] = "same phase"
    says: ClassVar[str] = "a force s sin(2π f t) + c cos(2π f t) at the centre of mass, t from each window's start"
    source: ClassVar[str] = "spec/model.md §5"
    parameters: ClassVar[tuple[Parameter, ...]] = oscillation_parameters("N", "force", scale=0.05, most=1000.0)

    def wrench(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """The force at G."""
        return at_centre(state, oscillation(state.time, state.extra, theta))

    def limits(self, context: Context) -> Mapping[str, Limit]:
        """A share of the weight."""
        return {parameter.name: share_of_weight(context) for parameter in self.parameters[:6]}


@dataclass(frozen=True)
class PeriodicForceOwnPhase(PeriodicForce):
    """The same with a phase of each window: F = s sin(2π f t + φ) + c cos(2π f t + φ)."""

    variant: ClassVar[str] = "own phase"
    says: ClassVar[str] = (
        "a force s sin(2π f t + φ) + c cos(2π f t + φ) at the centre of mass, φ differs between windows"
    )
    extra_states: ClassVar[tuple[ExtraState, ...]] = (PHASE,)
    of_each_window: ClassVar[bool] = True


@dataclass(frozen=True)
class FrameSway(NamedEffect):
    """The frame is displaced by u = s sin(2π f t) + c cos(2π f t), without turning.

    Exact: seen from the frame nothing moves but the platform, which feels −m ü at G; the cameras, which stand on the
    floor, see every point displaced by u. Hence position and twist of the model are those *against the frame*, also
    for effects such as air drag (their own sway, c u̇, is left out).
    """

    id: ClassVar[str] = "frame-sway"
    variant: ClassVar[str] = "same phase"
    says: ClassVar[str] = (
        "the frame moves by u = s sin(2π f t) + c cos(2π f t): −m ü at the centre of mass, cameras see + u"
    )
    source: ClassVar[str] = "d'Alembert; spec/model.md §5"
    parameters: ClassVar[tuple[Parameter, ...]] = oscillation_parameters("m", "displacement", scale=1e-4, most=0.1)

    def wrench(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """−m ü at G."""
        pulsation = 2 * np.pi * theta[6]
        return at_centre(state, state.mass * pulsation**2 * oscillation(state.time, state.extra, theta))

    def seen(self, point: ca.SX, state: PlatformState, theta: ca.SX) -> ca.SX:
        """Displaced by u."""
        return point + oscillation(state.time, state.extra, theta)


@dataclass(frozen=True)
class FrameSwayOwnPhase(FrameSway):
    """The same with a phase of each window."""

    variant: ClassVar[str] = "own phase"
    says: ClassVar[str] = "the frame moves by u = s sin(2π f t + φ) + c cos(2π f t + φ), φ of each window"
    extra_states: ClassVar[tuple[ExtraState, ...]] = (PHASE,)
    of_each_window: ClassVar[bool] = True
