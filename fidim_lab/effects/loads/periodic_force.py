"""A force that comes and goes at one frequency: a fan, a pump, the floor."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from fidim_lab.effects.effect import NamedEffect, Parameter
from fidim_lab.effects.loads.constant_force import share_of_weight
from fidim_lab.effects.loads.oscillation import PHASE, oscillation, oscillation_parameters
from fidim_lab.effects.plausibility import Context, Limit
from fidim_lab.effects.wrenches import at_centre
from fidim_lab.model.slots import ExtraState, PlatformState


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
