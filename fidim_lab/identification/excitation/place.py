"""The place of an excitation: what the winches may do there, and the wanted swing."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from fidim_lab.arrays import PerCable
from fidim_lab.data.records import Body, Robot
from fidim_lab.identification.excitation.strokes import Chain
from fidim_lab.model.equilibria import pose_from_lengths
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.statics import Equilibrium
from fidim_lab.model.swing import Swing, swing_about

MASS_OFF = 0.05
"""part by which the platform's mass, and so every tension, may be off"""
SPARE_TENSION = 0.005
"""of the span that tensions may have, kept at both ends"""


@dataclass(frozen=True)
class WinchLimits:
    """What the winches may do while they excite."""

    speed: float = 0.3
    """m/s"""
    acceleration: float = 1.0
    """m/s²"""
    offset: float = 0.06
    """m away from the equilibrium's lengths"""
    seconds: float = 12.0
    """for all chains"""
    lengths: tuple[tuple[float, float], ...] = ()
    """m, shortest and longest that each cable may be; empty where that is not known"""

    def ways(self, held: PerCable) -> PerCable:
        """How far (m) each cable may go to both sides of the length held."""
        free = [max(min(at - low, high - at), 0.0) for at, (low, high) in zip(held, self.lengths, strict=False)]
        return np.minimum(self.offset, [*free, *[np.inf] * (len(held) - len(free))])

    def reach(self, held: PerCable, direction: PerCable) -> float:
        """How far (m) strokes may go to both sides of the lengths held, along a direction of largest entry 1."""
        moved = np.abs(direction) > 0
        return float((self.ways(held)[moved] / np.abs(direction[moved])).min(initial=self.offset))

    def used(self, held: PerCable, chain: Chain, faster: float = 1.0) -> float:
        """The part of what the winches may do that strokes use, of what they use most of. faster: than they say."""
        ways = np.maximum(self.ways(held), 1e-9)
        far = float((np.abs(chain.direction) / ways).max())
        return max(far, chain.speed * faster / self.speed, chain.acceleration * faster**2 / self.acceleration)


@dataclass(frozen=True, eq=False)
class ExcitationPlace:
    """An equilibrium where the winches excite."""

    mechanism: Mechanism
    body: Body
    equilibrium: Equilibrium
    swing: Swing

    @staticmethod
    def at(mechanism: Mechanism, lengths: PerCable, body: Body | None = None) -> "ExcitationPlace":
        """By the nominal body unless given. Raises InfeasibleError where the platform does not rest there."""
        body = body or mechanism.robot.nominal
        equilibrium = pose_from_lengths(mechanism, body, lengths)
        return ExcitationPlace(mechanism, body, equilibrium, swing_about(mechanism, body, equilibrium))

    def beside(self, body: Body) -> "ExcitationPlace":
        """Another body at the same lengths, on the same branch. Raises InfeasibleError where it does not rest there."""
        equilibrium = pose_from_lengths(self.mechanism, body, self.equilibrium.lengths, self.equilibrium.pose)
        return ExcitationPlace(self.mechanism, body, equilibrium, swing_about(self.mechanism, body, equilibrium))

    @property
    def robot(self) -> Robot:
        """As the mechanism has it."""
        return self.mechanism.robot


def inside(tension: tuple[float, float]) -> tuple[float, float]:
    """What tensions (N) by the file's mass may be, so that the true ones keep these limits."""
    spare = SPARE_TENSION * (tension[1] - tension[0])
    return tension[0] * (1 + MASS_OFF) + spare, tension[1] / (1 + MASS_OFF) - spare


def wanted_amplitudes(place: ExcitationPlace, displacement: Float[np.ndarray, "2"]) -> Float[np.ndarray, " modes"]:
    """How far each mode would swing (marker, m) were the platform let go with the marker displaced so in x, y (m)."""
    swing = place.swing
    # of all ways to have the marker there, the one with the least potential energy: what a hand's pull at it gives
    stiffness = (2 * np.pi * swing.frequencies) ** 2
    xy = swing.markers[:2]
    if len(stiffness) <= 2:
        q = np.linalg.lstsq(xy, displacement, rcond=None)[0]
    else:
        q = (xy / stiffness).T @ np.linalg.pinv(xy / stiffness @ xy.T) @ displacement
    return np.abs(q) * swing.lever
