"""The input of a design, and the result of one evaluation."""

from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np
from jaxtyping import Float

from fidim_lab.data.records import Robot
from fidim_lab.errors import SetupError
from fidim_lab.identification.excitation.place import WinchLimits
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.grid import Resolution

SAMPLED = Resolution(intervals=6, block=0.2)
"""nodes every 0.02–0.05 s: derivatives good to 1e-3, enough to descend by; accepted designs are simulated anew"""


@dataclass(frozen=True)
class ByWinches:
    """Winches that excite: displacements are then what they can give, whatever body hangs there."""

    limits: WinchLimits = field(default_factory=WinchLimits)
    damping: float = 0.08
    """ζ, the most there may be: with less it swings farther by the same strokes"""


class Criterion(StrEnum):
    """The criterion to minimise."""

    C = "C"
    """(s_1 + 1) / s_9 of the stacked regressor (Eq. 40), the paper's"""
    A = "A"
    """mean variance of the maximum-likelihood estimate, each parameter in units of what it may plausibly be off"""
    D = "D"
    """volume of the estimate's confidence ellipsoid (log-determinant of the covariance)"""


DISPLACED = 2
"""coordinates in which a hand displaces the marker: a design plans as many free motions at most"""


def can_be_designed(robot: Robot) -> bool:
    """Whether equilibria and displacements of this robot can be designed."""
    return robot.freedoms <= DISPLACED


@dataclass(frozen=True, eq=False)
class DesignTask:
    """Eq. 41–42: n_e windows of `seconds`, each from rest at a displaced pose with the motors locked."""

    robot: Robot
    equilibria: int = 12
    samples: int = 100
    """of each window, evenly spaced, that enter W"""
    seconds: float = 10.0
    criterion: Criterion = Criterion.C
    conditioning: float = 25.0
    """largest condition number of Ξ over the dependent coordinates at any time; metres and radians as they are"""
    native: bool = True
    winches: ByWinches | None = None
    """what sets the platform swinging where no hand does"""
    bodies: tuple[np.ndarray, ...] = ()
    """further bodies (nine base parameters) for which A and D are averaged: a design robust to wrong CAD values"""

    def __post_init__(self) -> None:
        """Raise SetupError for what cannot be designed."""
        if not can_be_designed(self.robot):
            raise SetupError(
                f"fidim design displaces the marker along x and y: it covers four and five cables, not {self.robot.n}.",
                hint="For fewer cables take equilibria at random: fidim dry-run --robot FILE --out rehearsal writes "
                "rehearsal/plan.toml.",
            )
        if self.equilibria * self.robot.freedoms * self.samples < 10:
            raise SetupError(
                f"{self.equilibria} equilibria with {self.samples} samples cannot identify nine parameters."
            )

    @property
    def axes(self) -> tuple[int, ...]:
        """Free coordinates: the marker's x, y (paper §5.1); x alone where there is one freedom."""
        return (0, 1)[: max(1, self.robot.freedoms)] if self.robot.freedoms <= 2 else (0, 1)

    @property
    def shared(self) -> Float[np.ndarray, "9"]:
        """The body that is designed for: nominal (Eq. 43)."""
        return self.robot.nominal.vector

    @property
    def width(self) -> int:
        """Unknowns of a window: cable lengths and displacement, n + λ."""
        return self.robot.n + len(self.axes)

    def mechanism(self) -> Mechanism:
        """The model, compiled where a compiler is found."""
        return Mechanism(self.robot, native=self.native)
