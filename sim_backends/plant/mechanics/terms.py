"""The forces on the platform besides its cables' tension: weight, the operator's hand, and the hidden ones.

Each term is a function of the `Platform` that gives a `Wrench` about G in the world frame. `TERMS` maps the ids of the
catalogue to them; an id that is absent there enters somewhere else (geometry, stretch, inertia, sensors).
"""

from collections.abc import Callable, Mapping, Sequence

import casadi as ca

from sim_backends.plant.hidden import HiddenEffect
from sim_backends.plant.mechanics.kinematics import CableEnd, Platform, PlatformPoint, oscillation, sticking
from sim_backends.plant.mechanics.outside_terms import OUTSIDE_TERMS
from sim_backends.plant.mechanics.wrench import Term, Wrench
from sim_backends.plant.world import World

DRY_RATE = 0.01
"""rad/s within which a dry torque builds up: small against 1 rad/s, the rate of a swinging platform's joints"""


def applied(platform: Platform) -> Wrench:
    """All that acts on the platform but its cables and the operator's hand."""
    wrenches = [_weight(platform)]
    wrenches += [TERMS[e.id](platform, e) for e in platform.world.hidden if e.id in TERMS]
    return Wrench(sum((w.force for w in wrenches), ca.SX.zeros(3)), sum((w.moment for w in wrenches), ca.SX.zeros(3)))


def dry(rate: ca.SX) -> ca.SX:
    """The sign of a rate, smoothed around zero."""
    return ca.tanh(rate / DRY_RATE)


def _at(point: PlatformPoint, force: ca.SX) -> Wrench:
    return Wrench(force, ca.cross(point.arm, force))


def _at_centre(force: ca.SX) -> Wrench:
    return Wrench(force, ca.SX.zeros(3))


def _weight(platform: Platform) -> Wrench:
    return _at_centre(ca.SX(platform.world.gravity * platform.world.mass))


def hand_push(platform: Platform, law: ca.SX) -> Wrench:
    """The operator's hand: spring and damper to where it wants the marker, damper of rotation, steady force."""
    marker = platform.point(platform.world.markers[0])
    force = law[3:6] * (law[0:3] - marker.position) - law[6:9] * marker.velocity + law[10:13]
    wrench = _at(marker, force)
    return Wrench(force, wrench.moment - law[9] * platform.omega)


def _air_drag_linear(platform: Platform, effect: HiddenEffect) -> Wrench:
    return _at_centre(-effect["c"] * platform.velocity)


def _air_drag_quadratic(platform: Platform, effect: HiddenEffect) -> Wrench:
    # The tiny term keeps the derivative finite at rest.
    speed = ca.sqrt(ca.dot(platform.velocity, platform.velocity) + 1e-16)
    return _at_centre(-effect["c"] * speed * platform.velocity)


def _rotational_drag(platform: Platform, effect: HiddenEffect) -> Wrench:
    return Wrench(ca.SX.zeros(3), -effect["c"] * platform.omega)


def _rotational_drag_quadratic(platform: Platform, effect: HiddenEffect) -> Wrench:
    omega = platform.omega
    return Wrench(ca.SX.zeros(3), -effect["c"] * ca.sqrt(ca.dot(omega, omega) + 1e-16) * omega)


def _at_each_cable(platform: Platform, force: Callable[[CableEnd], ca.SX]) -> Wrench:
    wrenches = [_at(end.point, force(end)) for end in platform.cables]
    return Wrench(sum((w.force for w in wrenches), ca.SX.zeros(3)), sum((w.moment for w in wrenches), ca.SX.zeros(3)))


def _about_swivel(end: CableEnd, torque: ca.SX) -> ca.SX:
    """The force at A that does the work of a torque about the swivel axis."""
    return torque / end.tangent.lever * end.tangent.across


def bending(platform: Platform, effect: HiddenEffect, k: int) -> ca.SX:
    """Rate (n), 1/s, at which the bristles of the k-th swivel friction that gives way bend (Dahl)."""
    turned = ca.vertcat(*(end.tangent.swivel_rate(end.velocity) for end in platform.cables))
    return (turned - ca.fabs(turned) * platform.bristles[k]) / effect["give"]


def _swivel_friction(platform: Platform, effect: HiddenEffect) -> Wrench:
    if effect["give"] > 0:
        bends = iter(ca.vertsplit(platform.bristles[sticking(platform.world).index(effect)]))
        return _at_each_cable(platform, lambda end: _about_swivel(end, -effect["c"] * next(bends)))
    return _at_each_cable(
        platform,
        lambda end: _about_swivel(end, -effect["c"] * dry(end.tangent.swivel_rate(end.velocity))),
    )


def _swivel_damping(platform: Platform, effect: HiddenEffect) -> Wrench:
    return _at_each_cable(
        platform,
        lambda end: _about_swivel(end, -effect["c"] * end.tangent.swivel_rate(end.velocity)),
    )


def _pulley_friction(platform: Platform, effect: HiddenEffect) -> Wrench:
    def force(end: CableEnd) -> ca.SX:
        rate = end.tangent.wrap_rate(end.velocity)
        torque = -effect["viscous"] * rate - effect["dry"] * dry(rate)
        return torque / end.tangent.free * end.tangent.normal

    return _at_each_cable(platform, force)


def _attachment_friction(platform: Platform, effect: HiddenEffect) -> Wrench:
    """Torque against ω − t × Ȧ/ρ on the platform; the cable hands the reaction on as a force across itself."""
    total = Wrench(ca.SX.zeros(3), ca.SX.zeros(3))
    for end in platform.cables:
        along, free = end.tangent.along, end.tangent.free
        slip = platform.omega - ca.cross(along, end.velocity) / free
        speed = ca.sqrt(ca.dot(slip, slip) + DRY_RATE**2)
        torque = -(effect["viscous"] + effect["dry"] / speed) * slip
        reaction = _at(end.point, -ca.cross(torque, along) / free)
        total = Wrench(total.force + reaction.force, total.moment + reaction.moment + torque)
    return total


def _cable_torsion(platform: Platform, effect: HiddenEffect) -> Wrench:
    """The torque of each twisted cable about itself, and what keeps its energy: forces across it and along it.

    The twist is the platform's turn φ about the cable, 2 atan(v·t/w). Its rate is that of v and w by ω, and that of t,
    which turns with wrap and swivel.
    """
    w, v = platform.quaternion[0], platform.quaternion[1:4]
    force = moment = ca.SX.zeros(3)
    for end, cable in zip(platform.cables, platform.world.cables, strict=True):
        bend = end.tangent
        twist, by_turning, size = _twist(platform, bend.along)
        torque = (effect["p"] - effect["k"] * twist) / bend.free
        wrapping = ca.dot(bend.normal, v) / bend.free * bend.normal
        swivelling = ca.dot(bend.across, v) * ca.dot(bend.along, bend.outward) / bend.lever * bend.across
        stored = (effect["k"] / 2 * twist - effect["p"]) * twist / bend.free
        shortening = stored / bend.free * (bend.along - cable.radius / bend.free * bend.normal)
        here = _at(end.point, torque * 2 * w / size * (wrapping + swivelling) + shortening)
        force, moment = force + here.force, moment + here.moment + torque * by_turning
    heading, by_turning, _ = _twist(platform, ca.SX([0.0, 0.0, 1.0]))
    return Wrench(force, moment - effect["hose"] * heading * by_turning)


def _twist(platform: Platform, axis: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """The platform's turn about an axis (rad), its rate for each rad/s of ω (3), and w² + (v·axis)²."""
    w, v = platform.quaternion[0], platform.quaternion[1:4]
    about = ca.dot(v, axis)
    size = w**2 + about**2
    return 2 * ca.atan(about / w), (w**2 * axis + w * ca.cross(v, axis) + about * v) / size, size


def _constant_force(platform: Platform, effect: HiddenEffect) -> Wrench:
    return _at_centre(ca.SX(effect.vector("fx", "fy", "fz")))


def _body_force(platform: Platform, effect: HiddenEffect) -> Wrench:
    force, torque = effect.vector("fx", "fy", "fz"), effect.vector("tx", "ty", "tz")
    return Wrench(platform.rotation @ ca.DM(force), platform.rotation @ ca.DM(torque))


def _periodic_force(platform: Platform, effect: HiddenEffect) -> Wrench:
    force, _, _ = oscillation(effect, platform.now[0])
    return _at_centre(ca.SX.zeros(3) if platform.still else force)


def _umbilical(platform: Platform, effect: HiddenEffect) -> Wrench:
    end = platform.point(effect.vector("bx", "by", "bz"))
    reach = end.position - ca.DM(effect.vector("x", "y", "z") + platform.world.middle)
    if effect["rest"] <= 0:
        return _at(end, -effect["k"] * reach - effect["c"] * end.velocity)
    length = ca.norm_2(reach)
    direction = reach / length
    pull = effect["k"] * (length - effect["rest"]) + effect["c"] * ca.dot(direction, end.velocity)
    return _at(end, -ca.if_else(length > effect["rest"], pull, 0.0) * direction)


def loose_acceleration(platform: Platform, effect: HiddenEffect) -> tuple[PlatformPoint, ca.SX]:
    """Where a loose mass is held, and what its spring and damper give it, m/s²."""
    hold = platform.point(effect.vector("bx", "by", "bz"))
    w = 2 * ca.pi * effect["f"]
    if platform.still:
        return hold, ca.SX(-platform.world.gravity)
    position, velocity = platform.loose[platform.world.effects("loose-mass").index(effect)]
    return hold, w**2 * (hold.position - position) + 2 * effect["zeta"] * w * (hold.velocity - velocity)


def stalk_acceleration(platform: Platform, effect: HiddenEffect, k: int) -> ca.SX:
    """What the k-th stalk gives its marker, m/s²."""
    foot, w = platform.point(platform.world.markers[0]), effect["k"] ** -0.5
    position, velocity = platform.stalks[k]
    return w**2 * (foot.position - position) + 2 * effect["zeta"] * w * (foot.velocity - velocity)


def _loose_mass(platform: Platform, effect: HiddenEffect) -> Wrench:
    hold, pulled = loose_acceleration(platform, effect)
    return _at(hold, -effect["m"] * pulled)


def _hand_contact(platform: Platform, effect: HiddenEffect) -> Wrench:
    start, stop, t = effect["start"], effect["stop"], platform.now[1]
    touching = ca.logic_and(t > start, t < stop)
    if effect["window"]:
        touching = ca.logic_and(touching, platform.now[2] == effect["window"])
    push = ca.if_else(touching, ca.sin(ca.pi * (t - start) / (stop - start)) ** 2, 0.0)
    marker = platform.point(platform.world.markers[0])
    return _at(marker, ca.SX(0.0 if platform.still else push) * ca.SX(effect.vector("fx", "fy", "fz")))


def _unknown(platform: Platform, effect: HiddenEffect) -> Wrench:
    away = (platform.centre - ca.DM(effect.vector("x", "y", "z") + platform.world.middle)) / effect["w"]
    return _at_centre(effect["k"] * away * ca.exp(-ca.dot(away, away) / 2))


def with_tension(world: World) -> tuple[HiddenEffect, ...]:
    """What goes with the cables' tensions beside their pull."""
    return tuple(e for e in world.effects("lay-torque", "pulley-friction") if e["c" if e.id == "lay-torque" else "arm"])


def per_newton(end: CableEnd, effects: Sequence[HiddenEffect]) -> Wrench:
    """What goes with a cable's tension beside its pull: force and moment about G for each newton."""
    bend = end.tangent
    force = moment = ca.SX.zeros(3)
    for effect in effects:
        if effect.id == "lay-torque":
            moment = moment + effect["c"] * bend.along
        if effect.id == "pulley-friction":
            force = force - effect["arm"] * dry(bend.wrap_rate(end.velocity)) / bend.free * bend.normal
    return Wrench(force, moment + ca.cross(end.point.arm, force))


TERMS: Mapping[str, Term] = {
    "air-drag-linear": _air_drag_linear,
    "air-drag-quadratic": _air_drag_quadratic,
    "rotational-drag": _rotational_drag,
    "rotational-drag-quadratic": _rotational_drag_quadratic,
    "swivel-friction": _swivel_friction,
    "swivel-damping": _swivel_damping,
    "pulley-friction": _pulley_friction,
    "attachment-friction": _attachment_friction,
    "cable-torsion": _cable_torsion,
    "constant-force": _constant_force,
    "body-force": _body_force,
    "periodic-force": _periodic_force,
    "umbilical": _umbilical,
    "loose-mass": _loose_mass,
    "hand-contact": _hand_contact,
    "unknown": _unknown,
    **OUTSIDE_TERMS,
}
