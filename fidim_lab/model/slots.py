"""The places of the model into which physics that was left out can be put .

An effect overrides the slots it needs and leaves the others neutral; it does nothing at its `absent` θ. The baseline
and a completed model are the same code with a different list of effects. Slots speak SI with forces in N and masses in
kg: `contributions` and `Mechanism` divide by the robot's mass where the model counts per unit mass.

    geometry        constants of a cable               cable_length    what an encoder reads too much
    length_drift    a cable that grows in time         compliance      stretch under tension
    wrench          force and torque on the platform   tension_wrench  the same for each newton of a tension
    kinetic_energy  inertia that the platform drags along
    extra_*         states of its own                  stalk           what a marker stands on
    marker, seen, true_time   what the cameras make of it
    rate_read       what a gyroscope makes of it
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import casadi as ca
import numpy as np

from fidim_lab.errors import OurBugError
from fidim_lab.model.geometry import CableConstants, CableExpressions, skew


@dataclass(frozen=True, eq=False)
class PlatformState:
    """What a slot may depend on, as expressions in the world frame, SI. Position and rotation must be symbols."""

    time: ca.SX
    """s since the start of the window"""
    position: ca.SX
    rotation: ca.SX
    """body → world (3 × 3)"""
    twist: ca.SX
    """[ṗ; ω] (6)"""
    cables: tuple[CableExpressions, ...]
    com: ca.SX | None = None
    """R s, from P to the centre of mass G (3), m; effects that act at G need it"""
    extra: ca.SX = field(default_factory=lambda: ca.SX.zeros(0))
    """extra states: of all effects, in their order; inside a slot of that effect alone"""
    mass: float = 1.0
    """kg, of the robot file; set for the slots by the mechanism"""
    gravity: ca.SX = field(default_factory=lambda: ca.SX.zeros(3))
    """m/s², of the robot file; set for the slots by the mechanism"""

    @property
    def spin(self) -> ca.SX:
        """ω (3), rad/s."""
        return self.twist[3:]

    @property
    def centre(self) -> ca.SX:
        """From P to G (3), m. Raises OurBugError where the equations of motion did not say it."""
        if self.com is None:
            raise OurBugError("An effect acts at the centre of mass, but this PlatformState has none: give it `com`.")
        return self.com

    def arm(self, place: Sequence[float] | np.ndarray | ca.SX) -> ca.SX:
        """From P to a place of the body frame (3), world frame, m."""
        return self.rotation @ ca.SX(place)

    def velocity(self, arm: ca.SX) -> ca.SX:
        """Velocity (3), m/s, of the point of the platform at `arm` from P (world frame, m)."""
        return self.twist[:3] + ca.cross(self.spin, arm)

    def rate(self, expression: ca.SX) -> ca.SX:
        """Time derivative of an expression of the pose (a scalar or a column), along the twist."""
        at = ca.vertcat(self.position, ca.vec(self.rotation))
        return ca.jtimes(expression, at, ca.vertcat(self.twist[:3], ca.vec(skew(self.spin) @ self.rotation)))

    def gradient(self, scalar: ca.SX) -> ca.SX:
        """g (6) of a scalar function of the pose, so that its rate is g · [ṗ; ω]: −g is the wrench of a potential."""
        by_rotation = ca.gradient(scalar, ca.vec(self.rotation))
        columns = [by_rotation[3 * k : 3 * k + 3] for k in range(3)]
        torque = sum((ca.cross(self.rotation[:, k], columns[k]) for k in range(3)), ca.SX.zeros(3))
        return ca.vertcat(ca.gradient(scalar, self.position), torque)

    def of_effect(self, extra: ca.SX, mass: float, gravity: np.ndarray) -> "PlatformState":
        """The same state as one effect's slots see it."""
        return replace(self, extra=extra, mass=mass, gravity=ca.SX(ca.DM(gravity)))


@dataclass(frozen=True)
class ExtraState:
    """One state of an effect's own."""

    name: str
    unit: str
    spread: float
    """standard deviation, before any data, of its value at the start of a window around `Effect.extra_start`; 0: exact,
    inf: anything. Each window has its own."""
    tries: tuple[float, ...] = (0.0,)
    """values from which it is looked for where nothing is known of it"""


@dataclass(frozen=True, eq=False)
class Stalk:
    """A marker moves by give · y against the body, ÿ + 2 ζ ω ẏ + ω² y = ω² (g − acceleration of its foot)."""

    give: ca.SX
    """(3 × 3), body frame, s²; symmetric"""
    pulsation: ca.SX
    """ω, rad/s"""
    damping: ca.SX
    """ζ"""


class Effect:
    """An effect that does nothing; subclasses override what they change. θ holds the effect's own parameters."""

    parameters: ClassVar[tuple[Any, ...]] = ()
    """one entry for each θ, in order: names, or the records of `fidim_lab.effects`"""
    extra_states: ClassVar[tuple[ExtraState, ...]] = ()
    encoder_sees_stretch: ClassVar[bool] = False
    """whether `compliance` lies between drum and ground, so that the encoder turns with it"""
    anchor_yields: ClassVar[bool] = False
    """whether `compliance` is that of entry points, which move across their cables, too: a tension τ then gives the
    platform ½ τ² times its gradient by the pose"""

    @property
    def absent(self) -> np.ndarray:
        """A θ at which it does nothing."""
        return np.zeros(len(self.parameters))

    def geometry(self, number: int, cable: CableConstants, theta: ca.SX) -> CableConstants:
        """The constants of cable `number` (1-based), changed."""
        return cable

    def cable_length(self, number: int, theta: ca.SX) -> ca.SX:
        """What the encoder of cable `number` (1-based) reads beyond the true length, m; constant."""
        return ca.SX(0)

    def length_drift(self, number: int, time: ca.SX, theta: ca.SX) -> ca.SX:
        """How much longer cable `number` is than at time 0, unseen by its encoder, m; 0 at time 0."""
        return ca.SX(0)

    def compliance(self, number: int, cable: CableExpressions, theta: ca.SX) -> ca.SX:
        """Stretch of cable `number` for each newton of its tension, m/N; may depend on the pose."""
        return ca.SX(0)

    def stretch_damping(self, number: int, theta: ca.SX) -> ca.SX:
        """N s/m against the rate of that stretch; felt only where cables are springs (`elastic`)."""
        return ca.SX(0)

    def wrench(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """A further wrench [force; torque about P] on the platform (6), N and N m, world frame."""
        return ca.SX.zeros(6)

    def tension_wrench(self, number: int, state: PlatformState, theta: ca.SX) -> ca.SX:
        """Wrench (6) on the platform for each newton of cable `number`'s tension, 1 and m, world frame."""
        return ca.SX(6, 1)

    def kinetic_energy(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """Kinetic energy of what moves with the platform and the cables, J: quadratic in the twist."""
        return ca.SX(0)

    def extra_start(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """Its extra states at the start of a window (`state.time` is then 0)."""
        return ca.SX.zeros(len(self.extra_states))

    def extra_rates(self, state: PlatformState, theta: ca.SX) -> ca.SX:
        """Time derivatives of its extra states, 1/s."""
        return ca.SX.zeros(len(self.extra_states))

    def marker(self, number: int, place: ca.SX, theta: ca.SX) -> ca.SX:
        """Where marker `number` (1-based, the main one first) really is in the body frame (3), m."""
        return place

    def stalk(self, number: int, theta: ca.SX) -> Stalk | None:
        """What marker `number` (1-based) stands on, where that gives way."""
        return None

    def seen(self, point: ca.SX, state: PlatformState, theta: ca.SX) -> ca.SX:
        """What the cameras report for a point of the world (3), m, in a state."""
        return point

    def true_time(self, stamp: ca.SX, theta: ca.SX) -> ca.SX:
        """When a frame with this stamp (s since the start of the window) was really taken, s."""
        return stamp

    def rate_read(self, rate: ca.SX, theta: ca.SX) -> ca.SX:
        """What a gyroscope on the platform reads for an angular rate (3), rad/s, both in the body's axes."""
        return rate
