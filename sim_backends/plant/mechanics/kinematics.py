"""Where everything of a moving platform is, as CasADi expressions of the state in redundant coordinates.

State x: centre of mass G (3, world), unit quaternion q (4, scalar first, body → world), velocity of G (3, world),
angular velocity (3, body); then for each loose mass its position and velocity (3 + 3, world), and the same for each
marker on a stalk; then for each swivel friction that gives way the bend of every swivel's bristles (n). The reference
model uses P, a Gibbs vector and a world-frame twist instead.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from fidim_lab.data.records import Pose
from sim_backends.plant.hidden import HiddenEffect
from sim_backends.plant.mechanics.pulley import Tangent, tangent
from sim_backends.plant.world import World

POSE = slice(0, 7)
TWIST = slice(7, 13)
LOOSE = 13
"""index at which the loose masses begin; after them markers on stalks, and the bristles of swivels that stick"""
HAND_SIZE = 13
"""hand law: where it wants the marker (3), stiffness (3), damping (3), damping of rotation (1), steady force (3)"""


@dataclass(frozen=True, eq=False)
class PlatformPoint:
    """A point of the platform, world frame."""

    arm: ca.SX
    """from G, m"""
    position: ca.SX
    velocity: ca.SX
    centripetal: ca.SX
    """its acceleration where neither v̇ nor the angular acceleration contributes, m/s²"""


@dataclass(frozen=True, eq=False)
class CableEnd:
    """One attachment with its cable; velocities against the entry point, which may move with the frame."""

    point: PlatformPoint
    velocity: ca.SX
    tangent: Tangent


@dataclass(frozen=True, eq=False)
class Platform:
    """Everything that a force may depend on."""

    world: World
    centre: ca.SX
    quaternion: ca.SX
    """unit (4), scalar first, body → world"""
    rotation: ca.SX
    """the same as a matrix"""
    velocity: ca.SX
    spin: ca.SX
    """angular velocity, body frame"""
    cables: tuple[CableEnd, ...]
    loose: tuple[tuple[ca.SX, ca.SX], ...]
    """position and velocity of each loose mass"""
    stalks: tuple[tuple[ca.SX, ca.SX], ...]
    """position and velocity of each marker on a stalk, as if that could get longer too"""
    bristles: tuple[ca.SX, ...]
    """bend (n), −1 … 1, of the swivels' bristles of each effect that has such"""
    sway: tuple[ca.SX, ca.SX, ca.SX]
    """displacement, velocity, acceleration of the frame"""
    now: ca.SX
    """plant time, time in the window (s), number of the window"""
    still: bool
    """at rest: forces that come and go are left out"""

    @property
    def omega(self) -> ca.SX:
        """Angular velocity, world frame."""
        return self.rotation @ self.spin

    def point(self, body: np.ndarray) -> PlatformPoint:
        """A point given in the body frame (from P), m."""
        return _point(self.rotation, self.centre, self.velocity, self.spin, body - self.world.body.com)


def size(world: World) -> int:
    """Number of states."""
    return _bristles(world) + world.n * len(sticking(world))


def sticking(world: World) -> tuple[HiddenEffect, ...]:
    """Friction of swivels that builds up over a turn."""
    return tuple(effect for effect in world.effects("swivel-friction") if effect["give"] > 0)


def _bristles(world: World) -> int:
    """Index at which the bristles begin."""
    return stalks_at(world) + 6 * len(stalks(world))


def stalks(world: World) -> tuple[HiddenEffect, ...]:
    """What bends under the main marker."""
    return tuple(effect for effect in world.effects("marker-stalk") if effect["k"] > 0)


def stalks_at(world: World) -> int:
    """Index at which the markers on stalks begin."""
    return LOOSE + 6 * len(world.effects("loose-mass"))


def platform(world: World, x: ca.SX, now: ca.SX, *, still: bool = False) -> Platform:
    """The platform of a state; `still` leaves out the frame's sway and what comes and goes."""
    rotation = rotation_of(x[3:7])
    centre, velocity, spin = x[0:3], x[7:10], x[10:13]
    sway = _sway(() if still else world.effects("frame-sway"), now[0])
    ends: list[CableEnd] = []
    for cable in world.cables:
        point = _point(rotation, centre, velocity, spin, cable.a - world.body.com)
        ends.append(
            CableEnd(point, point.velocity - sway[1], tangent(point.position - ca.DM(cable.d) - sway[0], cable))
        )
    starts = range(LOOSE, stalks_at(world), 6)
    tips = range(stalks_at(world), _bristles(world), 6)
    bends = range(_bristles(world), size(world), world.n)
    return Platform(
        world=world,
        centre=centre,
        quaternion=x[3:7] / ca.norm_2(x[3:7]),
        rotation=rotation,
        velocity=velocity,
        spin=spin,
        cables=tuple(ends),
        loose=tuple((x[i : i + 3], x[i + 3 : i + 6]) for i in starts),
        stalks=tuple((x[i : i + 3], x[i + 3 : i + 6]) for i in tips),
        bristles=tuple(x[i : i + world.n] for i in bends),
        sway=sway,
        now=now,
        still=still,
    )


def rotation_of(q: ca.SX) -> ca.SX:
    """Rotation matrix of a quaternion (scalar first) of any length but 0."""
    w, v = q[0], q[1:4]
    scaled = (w**2 - ca.dot(v, v)) * ca.SX.eye(3) + 2 * (v @ v.T) + 2 * w * ca.skew(v)
    return scaled / ca.dot(q, q)


def quaternion_rate(q: ca.SX, spin: ca.SX) -> ca.SX:
    """q̇ = ½ q ⊗ (0, spin), spin in the body frame."""
    return 0.5 * ca.vertcat(-ca.dot(q[1:4], spin), q[0] * spin + ca.cross(q[1:4], spin))


def oscillation(effect: HiddenEffect, t: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """a sin(2π f t + ψ) of an effect with ax, ay, az, f, psi, and its first two derivatives."""
    w = 2 * np.pi * effect["f"]
    phase, a = w * t + effect["psi"], ca.DM(effect.vector("ax", "ay", "az"))
    return a * ca.sin(phase), a * w * ca.cos(phase), -a * w**2 * ca.sin(phase)


def matrix_of(q: np.ndarray) -> np.ndarray:
    """Rotation matrix of a unit quaternion (scalar first), as numbers."""
    w, x, y, z = q[:4].tolist()
    return np.array(
        [
            [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
        ]
    )


def quaternion_of(rotation: np.ndarray) -> np.ndarray:
    """Unit quaternion (scalar first) of a rotation matrix: the eigenvector of Bar-Itzhack's symmetric matrix."""
    m = rotation
    axial = np.array([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]])
    k = np.empty((4, 4))
    k[0, 0], k[0, 1:], k[1:, 0] = np.trace(m), axial, axial
    k[1:, 1:] = m + m.T - np.trace(m) * np.eye(3)
    return np.linalg.eigh(k)[1][:, -1]


def pose_of(world: World, x: np.ndarray) -> Pose:
    """The pose of P in a state."""
    rotation = matrix_of(x[3:7])
    return Pose(position=x[0:3] - rotation @ world.body.com, rotation=rotation)


def coordinates_of(world: World, pose: Pose) -> np.ndarray:
    """The seven pose coordinates of a state at a pose of P."""
    return np.concatenate([pose.position + pose.rotation @ world.body.com, quaternion_of(pose.rotation)])


def _point(rotation: ca.SX, centre: ca.SX, velocity: ca.SX, spin: ca.SX, arm_in_body: np.ndarray) -> PlatformPoint:
    b = ca.SX(arm_in_body)
    arm, turning = rotation @ b, ca.cross(spin, b)
    return PlatformPoint(
        arm=arm,
        position=centre + arm,
        velocity=velocity + rotation @ turning,
        centripetal=rotation @ ca.cross(spin, turning),
    )


def _sway(effects: tuple[HiddenEffect, ...], t: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    total = (ca.SX.zeros(3), ca.SX.zeros(3), ca.SX.zeros(3))
    for effect in effects:
        one = oscillation(effect, t)
        total = (total[0] + one[0], total[1] + one[1], total[2] + one[2])
    return total
