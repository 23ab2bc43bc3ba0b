"""A hose or cable that ties the platform to a fixed point, besides the cables that carry it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca
import numpy as np

from fidim_lab.data.records import Robot
from fidim_lab.effects.dissipation.drag import AirDragLinear
from fidim_lab.effects.effect import NamedEffect, Parameter, vector
from fidim_lab.effects.loads.constant_force import SHARE_OF_WEIGHT, ConstantForce
from fidim_lab.effects.plausibility import Context, Limit
from fidim_lab.effects.wrenches import at_arm
from fidim_lab.model.slots import PlatformState

GOING_SLACK = 5e-3
"""m of stretch around 0 over which a hose begins to pull"""
REACH = 0.7
"""m below the entry points: about where a platform hangs"""
FARTHEST = 20.0
"""m from the platform that a hose ends at most"""
RESTS = ((0.3, 1.0), (0.6, 1.0), (0.6, 0.6))
"""shares of the length that are tried as rest lengths, and how near the end is then taken to be"""
SEEN = 5.0
"""standard deviations of its stiffness by which a spring is seen; with less the evidence decides between the two"""
TRAVEL = 0.1
"""m that the platform moves at least: what a spring's force changes by must stay a disturbance"""
STIFFNESS = Parameter("k", "N/m", "a stiffness is positive", scale=0.5, low=0.0, high=1000.0, start=2.0)
DAMPING = Parameter("c", "N s/m", "a damping is positive", scale=0.05, low=0.0, high=100.0, start=0.2)


@dataclass(frozen=True)
class Umbilical(NamedEffect):
    """F = h − k A − c Ȧ at the point A = p + R b of the platform: a spring without rest length to the fixed point h/k.

    h = k E with E the fixed end: in h and k the force is linear, so the score needs no guess of where the end is. b has
    no score at k = 0; it starts at P, or where a platform's centre of mass is likely to be: at the wrong height a hose
    turns the platform, and drag at the centre of mass looked more like it.
    """

    id: ClassVar[str] = "umbilical"
    variant: ClassVar[str] = "always taut"
    says: ClassVar[str] = "a spring and damper to the fixed point h/k, F = h − k A − c Ȧ at A = p + R b"
    source: ClassVar[str] = "spec/model.md §5"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        STIFFNESS,
        DAMPING,
        *vector("h", "N", "stiffness times the place of the fixed end", scale=0.5, most=5000.0),
        *vector("b", "m", "platform's end, body frame", scale=0.1, most=0.5)[:2],
        Parameter("bz", "m", "platform's end, body frame, z", 0.1, low=-0.5, high=0.5, start=0.0, scan=(0.0, 0.2)),
    )

    @property
    def scanned(self) -> tuple[bool, ...]:
        """All but b have a score."""
        return (False,) * 5 + (True,) * 3

    def wrench(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """h − k A − c Ȧ at A."""
        arm = state.rotation @ theta[5:]
        return at_arm(arm, theta[2:5] - theta[0] * (state.position + arm) - theta[1] * state.velocity(arm))

    def parts(self, values: np.ndarray, sd: np.ndarray) -> tuple[tuple[NamedEffect, np.ndarray], ...]:
        """A drag and a steady force, where no spring is seen, or its end would be farther than any hose's."""
        k, c, force = values[0], values[1], values[2:5]
        if k > SEEN * np.nan_to_num(sd[0]) and k * FARTHEST > np.linalg.norm(force):
            return ()
        drag = ((AirDragLinear(), np.array([c])),) if c > 0 else ()
        return (*drag, (ConstantForce(), force))

    def wider(self, values: np.ndarray, robot: Robot) -> tuple[tuple[NamedEffect, np.ndarray], ...]:
        """With a rest length of some parts of what the platform's middle is away from the end that was found.

        A hose with a rest length pulls as if it were a weaker one without to a farther end.
        """
        k, c, place = values[0], values[1], values[5:]
        if k <= 0:
            return ()
        middle = np.mean([cable.d for cable in robot.cables], axis=0)
        below = np.array([0.0, 0.0, -REACH])
        end = values[2:5] / k - middle
        away = end - below
        distance = float(np.linalg.norm(away))
        starts = []
        for share, nearer in RESTS:
            near = below + nearer * away if distance > 0 else end
            rest = share * float(np.linalg.norm(near - below))
            starts.append(np.concatenate([[k / (1 - share), c], near, [rest], place]))
        return tuple((UmbilicalWithRest(), np.clip(start, *UmbilicalWithRest().bounds())) for start in starts)

    def limits(self, context: Context) -> Mapping[str, Limit]:
        """A hose carries no considerable part of the platform."""
        return {"k": _softness(context)}


@dataclass(frozen=True)
class UmbilicalWithRest(NamedEffect):
    """A hose to the fixed point E with a rest length: it pulls along itself, and only when stretched.

    F = −[k s + c ṡ] n where s = ‖A − E‖ − rest > 0, smoothed over 5 mm. E, b and rest have no score at k = 0: E and
    rest are scanned, b starts at P. E is counted from the mean of the entry points d as the robot file has them.
    """

    id: ClassVar[str] = "umbilical"
    variant: ClassVar[str] = "with rest length"
    says: ClassVar[str] = "a hose to a fixed point E, pulling k (‖A − E‖ − rest) + c d‖A − E‖/dt where stretched"
    source: ClassVar[str] = "spec/model.md §5"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        STIFFNESS,
        DAMPING,
        Parameter("x", "m", "fixed end", scale=0.2, low=-5.0, high=5.0, start=0.0, scan=(-0.7, 0.0, 0.7)),
        Parameter("y", "m", "fixed end", scale=0.2, low=-5.0, high=5.0, start=0.0, scan=(-0.7, 0.0, 0.7)),
        Parameter("z", "m", "fixed end", scale=0.2, low=-5.0, high=5.0, start=0.0, scan=(-1.5, 0.3)),
        Parameter(
            "rest", "m", "length below which it is slack", scale=0.1, low=0.0, high=5.0, start=0.5, scan=(0.3, 0.8)
        ),
        *vector("b", "m", "platform's end, body frame", scale=0.1, most=0.5),
    )

    @property
    def scanned(self) -> tuple[bool, ...]:
        """The platform's end has no score either; it is not scanned but starts at P."""
        return (False, False, *(True for _ in self.parameters[2:]))

    def wrench(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """The pull at b."""
        k, c, end, rest = theta[0], theta[1], theta[2:5], theta[5]
        arm = state.rotation @ theta[6:]
        middle = sum((cable.constants.d for cable in state.cables), ca.SX.zeros(3)) / len(state.cables)
        reach = state.position + arm - middle - end
        length = ca.norm_2(reach)
        stretch = length - rest
        soft = ca.sqrt(stretch**2 + GOING_SLACK**2)
        taut, pulled = (1 + stretch / soft) / 2, (stretch + soft) / 2
        rate = ca.dot(reach, state.velocity(arm)) / length
        return at_arm(arm, -(k * pulled + c * taut * rate) * reach / length)

    def limits(self, context: Context) -> Mapping[str, Limit]:
        """As without a rest length."""
        return {"k": _softness(context)}


def _softness(context: Context) -> Limit:
    most = SHARE_OF_WEIGHT * context.weight / TRAVEL
    return Limit(most, f"a hose whose pull changes by {most * TRAVEL:.0f} N over {TRAVEL:g} m is one more cable")
