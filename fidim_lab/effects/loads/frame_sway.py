"""The base frame moves while the cameras stand still."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca
import numpy as np

from fidim_lab.effects.effect import NamedEffect, Parameter
from fidim_lab.effects.loads.oscillation import PHASE, oscillation, oscillation_parameters
from fidim_lab.effects.wrenches import at_centre
from fidim_lab.model.slots import ExtraState, PlatformState


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
