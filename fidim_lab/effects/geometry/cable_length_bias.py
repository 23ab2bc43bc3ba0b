"""An encoder whose zero is wrong."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from fidim_lab.effects.effect import NamedEffect, Parameter


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
