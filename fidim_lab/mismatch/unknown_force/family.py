"""A family of wrenches: directions times features of the motion, each product with its own weight.

    w(t, pose, twist) = Σ_dk W_dk D_d(t, pose, twist) φ_k(t, pose, twist)

Linear in W; what is not linear (centres, widths, a frequency, an exponent) is its *shape*, which is searched.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from enum import Enum

import casadi as ca
import numpy as np
from jaxtyping import Float

from fidim_lab.mismatch.unknown_force.points import ForcePoint
from fidim_lab.model.batch import function, over_samples, rows
from fidim_lab.model.making import MAKING
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion.equations import Symbols
from fidim_lab.model.motion.rigid_body import BodyExpressions
from fidim_lab.model.sensitivity.equations import BODY
from fidim_lab.model.slots import PlatformState

Expression = Callable[[PlatformState, ca.SX], ca.SX]
"""(state, shape) → an expression"""


class Dependence(Enum):
    """The variables of the wrench, in words."""

    CENTRE = "points at a place in the room"
    GRADIENT = "changes evenly with the place"
    POSITION = "depends on where the platform is"
    BRAKE = "opposes the motion, more in some places than in others"
    SPEED = "goes along with the velocity"
    VELOCITY = "depends on the velocity"
    SPIN = "goes along with the rate of turning"
    ACROSS = "acts across the turning"
    TURNING = "depends on how fast the platform turns"
    ORIENTATION = "depends on how the platform is turned"
    MOMENT = "acts for a moment"
    TIME = "depends on the time since the release"
    PERIODIC = "comes and goes at one frequency"
    DETENT = "repeats with the angle of the joints"
    CABLE = "acts where one cable is led or held"


@dataclass(frozen=True, eq=False)
class Family:
    """See the module; the wrench acts on the platform, world frame, N and N m."""

    dependence: Dependence
    label: str
    wrenches: Expression
    """D (6 × d)"""
    features: Expression
    """φ (k)"""
    shapes: tuple[Float[np.ndarray, " shape"], ...] = (np.zeros(0),)
    """which are tried; all have the same length: 0 where nothing is searched"""
    steps: Float[np.ndarray, " shape"] | None = None
    """how far to go from the best of them at first to search on; None: they are all"""
    point: ForcePoint = ForcePoint.CENTRE_OF_MASS
    """on which a force of the place acts"""
    cable: int | None = None
    """1-based, where it concerns one"""
    power: float | None = None
    """with which power of its rate it grows, where that is its shape"""
    scale: float | None = None
    """m, by which places are divided in a polynomial"""
    harmonics: int = 0
    """where windows meet it at times of their own: of how many its features are sin and cos in turn; the lowest has the
    frequency that is its shape, Hz"""
    knocks: bool = False
    """of these harmonics, and a constant before them, only together as short knocks make them"""
    box: Float[np.ndarray, "2 shape"] | None = None
    """lowest and highest shape that is searched"""

    def allows(self, shape: Float[np.ndarray, " shape"]) -> bool:
        """Whether a shape may be tried."""
        return self.box is None or bool(((shape >= self.box[0]) & (shape <= self.box[1])).all())

    def wrench(self, state: PlatformState, shape: ca.SX, weights: ca.SX) -> ca.SX:
        """(6), weights (d k) in the order of `courses`."""
        directions, features = self.wrenches(state, shape), self.features(state, shape)
        table = ca.reshape(weights, features.numel(), directions.size2())
        return directions @ (table.T @ features)


class Courses:
    """A family compiled for one mechanism: its directions and features along motions, for any shape."""

    def __init__(self, family: Family, mechanism: Mechanism, shared: Float[np.ndarray, " shared"]) -> None:
        self.family, self._shared = family, shared
        with MAKING:
            symbols = Symbols.of(mechanism)
            shape = ca.SX.sym("shape", len(family.shapes[0]))
            state = state_of(mechanism, symbols)
            directions, features = family.wrenches(state, shape), family.features(state, shape)
            inputs = [symbols.time, symbols.position, symbols.flat, symbols.twist, symbols.body, symbols.theta, shape]
            self._compiled = function("courses", inputs, [rows(directions), features])

    def at(
        self, sample: Sequence[np.ndarray], shape: Float[np.ndarray, " shape"]
    ) -> tuple[Float[np.ndarray, "W S 6 d"], Float[np.ndarray, "W S k"]]:
        """D and φ at samples [t (W S 1), positions (W S 3), rotations (W S 3 3), twists (W S 6)]."""
        windows, nodes = sample[0].shape[:2]
        rest = (self._shared[:BODY], self._shared[BODY:], np.asarray(shape))
        found = over_samples(self._compiled, windows * nodes, *sample, *rest)
        return found[0].reshape(windows, nodes, 6, -1), found[1].reshape(windows, nodes, -1)


def state_of(mechanism: Mechanism, symbols: Symbols) -> PlatformState:
    """The platform's state as slots see it, of symbols."""
    rotation = symbols.rotation
    return PlatformState(
        time=symbols.time,
        position=symbols.position,
        rotation=rotation,
        twist=symbols.twist,
        cables=mechanism.cables_at(symbols.position, rotation, symbols.theta),
        com=BodyExpressions.of(symbols.body, rotation).com,
    )


def bells(values: ca.SX, centres: ca.SX, width: ca.SX) -> ca.SX:
    """exp(−|z − c|² / 2 w²) for each row of `centres` (K × a) of a value z (a)."""
    apart = (ca.repmat(values.T, centres.size1(), 1) - centres) / width
    return ca.exp(-ca.sum2(apart**2) / 2)


def monomials(values: ca.SX, degrees: Iterable[int]) -> ca.SX:
    """All products of the entries of a column with these total degrees."""
    found: list[ca.SX] = []
    for degree in degrees:
        found += _products(values, degree, 0)
    return ca.vertcat(*found)


def _products(values: ca.SX, degree: int, first: int) -> list[ca.SX]:
    if degree == 0:
        return [ca.SX(1)]
    return [values[k] * rest for k in range(first, values.numel()) for rest in _products(values, degree - 1, k)]
