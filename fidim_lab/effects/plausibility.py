"""What is physically possible on a given robot: sizes, tensions and rates that bound the effects' parameters.

`Context.of(robot)` knows only the robot file; `Context.of_motion` takes tensions and rates from a motion, and is
sharper. The bounds are generous on purpose (a factor of two or more above what any such machine has): what they refuse
is impossible, not unlikely.
"""

from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from fidim_lab.arrays import CableSeries
from fidim_lab.data.records import Motion, Robot
from fidim_lab.model.batch import from_rows, function, over_samples
from fidim_lab.model.mechanism import Mechanism

FRICTION = 0.6
"""largest coefficient of friction of a bearing, eyelet or knot: dry steel on steel"""
JOINT_RADIUS = 0.02
"""m: largest lever at which a cable's attachment rubs"""
LEAST_RADIUS = 0.01
"""m: lever of the friction of a pulley whose radius the robot file gives as 0"""
AIR_DENSITY = 1.2
"""kg/m³"""
DRAG_COEFFICIENT = 2.0
"""largest of a bluff body"""
SAIL = 4.0
"""how many times wider than its attachments and markers a platform may be"""
FASTEST = 2.0
"""m/s of the centre of mass of any such platform"""
USUAL = 95.0
"""percentile of the rates of a motion that counts as their size"""


@dataclass(frozen=True)
class Limit:
    """The largest possible size of one parameter."""

    size: float
    why: str
    """continues «…, but»"""


@dataclass(frozen=True)
class Context:
    """Sizes of one robot and its motion."""

    mass: float
    """kg"""
    weight: float
    """N"""
    tension: tuple[float, ...]
    """usual tension of each cable, N"""
    radii: tuple[float, ...]
    """of each pulley, m"""
    width: float
    """m across the platform, from attachments and markers"""
    speed: float = FASTEST
    """of the centre of mass, m/s"""
    swivel_rate: float = 0.5
    """rad/s"""
    wrap_rate: float = 0.5
    slip_rate: float = 1.0
    """of the platform against its cables, rad/s"""
    free_length: float = 2.0
    """of a cable from its pulley to the platform, m"""
    level: float = 0.7
    """tx² + ty² of a cable's direction t: 1 for a level one"""

    @staticmethod
    def of(robot: Robot) -> "Context":
        """What the robot file alone says: cables that share the weight at a slant."""
        weight = robot.mass * float(np.linalg.norm(robot.gravity))
        places = np.array([*(cable.a for cable in robot.cables), *robot.markers])
        return Context(
            mass=robot.mass,
            weight=weight,
            tension=(weight * min(1.0, 2.0 / robot.n),) * robot.n,
            radii=tuple(cable.radius for cable in robot.cables),
            width=2.0 * float(np.linalg.norm(places - robot.nominal.com, axis=1).max()),
        )

    @staticmethod
    def of_motion(mechanism: Mechanism, motion: Motion, tensions: CableSeries) -> "Context":
        """Tensions (N, the mean of each cable) and rates as they are in a motion with these tensions (N n), N."""
        speeds, rates, lengths, levels = _course(mechanism, motion)
        swivel, wrap, slip = np.percentile(np.abs(rates), USUAL, axis=0).reshape(3, -1).max(axis=1)
        return replace(
            Context.of(mechanism.robot),
            tension=tuple(tensions.mean(axis=0).tolist()),
            speed=float(np.percentile(speeds, USUAL)),
            swivel_rate=float(swivel),
            wrap_rate=float(wrap),
            slip_rate=float(slip),
            free_length=float(lengths.mean()),
            level=float(levels.mean()),
        )

    def bearing_torque(self, cable: int | None) -> Limit:
        """Largest friction torque in the bearings of a pulley, μ T r: of one cable, or the least that all allow."""
        chosen = range(len(self.radii)) if cable is None else [cable - 1]
        torques = [FRICTION * self.tension[k] * max(self.radii[k], LEAST_RADIUS) for k in chosen]
        k = list(chosen)[int(np.argmin(torques))]
        return Limit(
            min(torques),
            f"friction on a pulley of {1e3 * max(self.radii[k], LEAST_RADIUS):.0f} mm under {self.tension[k]:.0f} N "
            f"cannot exceed μ T r (μ = {FRICTION:g})",
        )

    def joint_torque(self, cable: int | None) -> Limit:
        """Largest friction torque where a cable is attached."""
        tension = min(self.tension) if cable is None else self.tension[cable - 1]
        return Limit(
            FRICTION * tension * JOINT_RADIUS,
            f"friction of an attachment of {1e3 * JOINT_RADIUS:.0f} mm under {tension:.0f} N cannot exceed μ T r "
            f"(μ = {FRICTION:g})",
        )

    @property
    def quadratic_drag(self) -> Limit:
        """Largest ½ ρ C A of the platform, N s²/m²."""
        area = (SAIL * self.width) ** 2
        return Limit(
            0.5 * AIR_DENSITY * DRAG_COEFFICIENT * area,
            f"½ ρ C A of a platform {self.width:.2f} m across is less even with a sail of {area:.1f} m²",
        )

    @property
    def linear_drag(self) -> Limit:
        """The same as a linear coefficient, N s/m; of the fastest motion: a hose drags a slow platform as much."""
        return self._drag_at(FASTEST)

    @property
    def rotational_drag(self) -> Limit:
        """Largest drag of the rotation: that of air on a sail, or of a hose; N m s."""
        drag = self._drag_at(self.speed)
        return Limit(drag.size * self.width**2, drag.why)

    def _drag_at(self, speed: float) -> Limit:
        drag = self.quadratic_drag
        return Limit(drag.size * speed, f"{drag.why} at {speed:.2g} m/s")


def over_rate(limit: Limit, rate: float) -> Limit:
    """The viscous coefficient that gives this torque at a rate (rad/s)."""
    return Limit(limit.size / max(rate, 1e-6), f"{limit.why} at {rate:.2g} rad/s")


def _course(mechanism: Mechanism, motion: Motion) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Speed of the nominal G (N,), rates of swivels, wraps and attachments (N, 3 n), free lengths and levels (N, n)."""
    compiled = mechanism.compiled("course of cables", _compile_course)
    given = (motion.positions, motion.rotations, motion.twists, mechanism.theta)
    speeds, rates, lengths, levels = over_samples(compiled, len(motion.t), *given)
    return speeds[:, 0], rates, lengths, levels


def _compile_course(mechanism: Mechanism) -> ca.Function:
    position, flat, twist = ca.SX.sym("position", 3), ca.SX.sym("rotation", 9), ca.SX.sym("twist", 6)
    theta = ca.SX.sym("theta", mechanism.theta.size)
    rotation, spin = from_rows(flat, 3, 3), twist[3:]
    swivel, wrap, slip, lengths, levels = [], [], [], [], []
    for cable in mechanism.cables_at(position, rotation, theta):
        velocity = twist[:3] + ca.cross(spin, cable.arm)
        swivel.append(ca.dot(cable.swivel_gradient, velocity))
        wrap.append(ca.dot(cable.wrap_gradient, velocity))
        slip.append(ca.norm_2(spin - ca.cross(cable.direction, velocity) / cable.free_length))
        lengths.append(cable.free_length)
        levels.append(ca.sumsqr(cable.direction[:2]))
    centre = twist[:3] + ca.cross(spin, rotation @ ca.SX(ca.DM(mechanism.robot.nominal.com)))
    rates = ca.vertcat(*swivel, *wrap, *slip)
    told = [ca.norm_2(centre), rates, ca.vertcat(*lengths), ca.vertcat(*levels)]
    return function("course_of_cables", [position, flat, twist, theta], told)
