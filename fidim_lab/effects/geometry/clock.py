"""The motion capture's clock against true time: it runs at another rate, or stamps frames early or late."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from fidim_lab.effects.effect import NamedEffect, Parameter


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
