"""Hidden forces on MuJoCo's platform, as plain numbers: each is a function of the platform's state now.

`SUPPORTED` says which effects this world can hide. What is not here needs another model than rigid cables on light
swivels (stretch, friction in joints, masses in motion).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from fidim_lab.arrays import Matrix3, Vector3
from fidim_lab.errors import SetupError
from sim_backends.plant.hidden import HiddenEffect
from sim_backends.plant.session_kinds import SESSION
from sim_backends.plant.world import World


@dataclass(frozen=True, eq=False)
class Moment:
    """The platform at one moment, world frame."""

    world: World
    t: float
    """s, of the experiment"""
    in_window: float
    """s since the release"""
    window: int
    position: Vector3
    """of P, m"""
    rotation: Matrix3
    velocity: Vector3
    """of P, m/s"""
    omega: Vector3
    """rad/s"""

    def point(self, body: Vector3) -> tuple[Vector3, Vector3]:
        """Position and velocity of a point given in the body frame."""
        arm = self.rotation @ body
        return self.position + arm, self.velocity + np.cross(self.omega, arm)

    @property
    def centre(self) -> tuple[Vector3, Vector3]:
        """Position and velocity of G."""
        return self.point(self.world.body.com)


Load = np.ndarray
"""(6,) force (N) and moment about G (N m), world frame"""


def load(moment: Moment) -> Load:
    """The sum of all hidden forces."""
    total = np.zeros(6)
    for effect in moment.world.effects(*FORCES):
        total += FORCES[effect.id](moment, effect)
    return total


def refuse_unsupported(world: World) -> None:
    """Raise SetupError where the world hides what MuJoCo's model does not have."""
    for effect in world.hidden:
        if effect.id not in SUPPORTED:
            raise SetupError(
                f"--hide {effect.id}: the mujoco backend cannot simulate it.",
                hint=f"It can hide {', '.join(SUPPORTED)}. For the others take --backend native.",
            )


def _at_centre(force: Vector3) -> Load:
    return np.concatenate([force, np.zeros(3)])


def _at(moment: Moment, place: Vector3, force: Vector3) -> Load:
    return np.concatenate([force, np.cross(place - moment.centre[0], force)])


def _air_drag_linear(moment: Moment, effect: HiddenEffect) -> Load:
    return _at_centre(-effect["c"] * moment.centre[1])


def _air_drag_quadratic(moment: Moment, effect: HiddenEffect) -> Load:
    velocity = moment.centre[1]
    return _at_centre(-effect["c"] * float(np.linalg.norm(velocity)) * velocity)


def _rotational_drag(moment: Moment, effect: HiddenEffect) -> Load:
    return np.concatenate([np.zeros(3), -effect["c"] * moment.omega])


def _rotational_drag_quadratic(moment: Moment, effect: HiddenEffect) -> Load:
    return np.concatenate([np.zeros(3), -effect["c"] * float(np.linalg.norm(moment.omega)) * moment.omega])


def _body_force(moment: Moment, effect: HiddenEffect) -> Load:
    both = effect.vector("fx", "fy", "fz"), effect.vector("tx", "ty", "tz")
    return np.concatenate([moment.rotation @ part for part in both])


def _constant_force(moment: Moment, effect: HiddenEffect) -> Load:
    return _at_centre(effect.vector("fx", "fy", "fz"))


def _periodic_force(moment: Moment, effect: HiddenEffect) -> Load:
    phase = 2 * np.pi * effect["f"] * moment.t + effect["psi"]
    return _at_centre(effect.vector("ax", "ay", "az") * np.sin(phase))


def _umbilical(moment: Moment, effect: HiddenEffect) -> Load:
    end, velocity = moment.point(effect.vector("bx", "by", "bz"))
    reach = end - (moment.world.middle + effect.vector("x", "y", "z"))
    rest, length = effect["rest"], float(np.linalg.norm(reach))
    if rest <= 0:
        return _at(moment, end, -effect["k"] * reach - effect["c"] * velocity)
    if length <= rest:
        return np.zeros(6)
    along = reach / length
    return _at(moment, end, -(effect["k"] * (length - rest) + effect["c"] * (along @ velocity)) * along)


def _hand_contact(moment: Moment, effect: HiddenEffect) -> Load:
    start, stop, t = effect["start"], effect["stop"], moment.in_window
    if not start < t < stop or effect["window"] not in (0.0, float(moment.window)):
        return np.zeros(6)
    push = np.sin(np.pi * (t - start) / (stop - start)) ** 2
    return _at(moment, moment.point(moment.world.markers[0])[0], push * effect.vector("fx", "fy", "fz"))


def _unknown(moment: Moment, effect: HiddenEffect) -> Load:
    away = (moment.centre[0] - moment.world.middle - effect.vector("x", "y", "z")) / effect["w"]
    return _at_centre(effect["k"] * np.exp(-(away @ away) / 2) * away)


FORCES: Mapping[str, Callable[[Moment, HiddenEffect], Load]] = {
    "air-drag-linear": _air_drag_linear,
    "air-drag-quadratic": _air_drag_quadratic,
    "rotational-drag": _rotational_drag,
    "rotational-drag-quadratic": _rotational_drag_quadratic,
    "constant-force": _constant_force,
    "body-force": _body_force,
    "periodic-force": _periodic_force,
    "umbilical": _umbilical,
    "hand-contact": _hand_contact,
    "unknown": _unknown,
}
GEOMETRY = ("anchor-offset", "attachment-offset", "pulley-radius", "cable-length-bias", "gravity-tilt", "marker-offset")
"""enter through the true geometry and lengths"""
MEASUREMENT = ("frame-misalignment", "capture-scale", "clock-rate", "time-offset", "sensor-fault", *SESSION)
"""enter through cameras and encoders"""
SUPPORTED = (*FORCES, *GEOMETRY, *MEASUREMENT)
