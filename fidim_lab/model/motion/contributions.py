"""What all effects of a mechanism put into the slots besides geometry, length and wrench, as expressions.

Per unit mass as the whole model: inertia over the robot's mass, compliance in metres for each N/kg of tension. For the
equations of motion themselves see `equations`. Each is structurally zero where no effect uses its slot.
"""

from collections.abc import Sequence

import casadi as ca

from fidim_lab.model.geometry import CableExpressions
from fidim_lab.model.mechanism import Mechanism, parts, states_of
from fidim_lab.model.slots import Effect, PlatformState, Stalk


def extra_count(mechanism: Mechanism) -> int:
    """Number of extra states of all effects."""
    return sum(len(effect.extra_states) for effect in mechanism.effects)


def inertia_at(mechanism: Mechanism, state: PlatformState, theta: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Added mass A (6 × 6) and bias b (6) per unit mass: what moves along takes A v̇ + b from the platform.

    Lagrange's equations of the effects' kinetic energy T in the quasi-velocities v = [ṗ; ω], ω in the world frame
    (Boltzmann–Hamel): d/dt ∂T/∂ṗ − ∂T/∂p and d/dt ∂T/∂ω − ω × ∂T/∂ω − ∂T/∂θ.
    """
    energy = sum(
        (effect.kinetic_energy(own, part) for own, effect, part in _with_states(mechanism, state, theta)), ca.SX(0)
    )
    if energy.is_zero():
        return ca.SX(6, 6), ca.SX(6, 1)
    energy = energy / mechanism.robot.mass
    mass = ca.hessian(energy, state.twist)[0]
    momentum = mass @ state.twist
    turning = ca.vertcat(ca.SX.zeros(3), ca.cross(state.spin, momentum[3:]))
    return mass, state.rate(momentum) - turning - state.gradient(energy)


def length_drifts_at(mechanism: Mechanism, time: ca.SX, theta: ca.SX) -> ca.SX:
    """How much longer than at time 0 the cables are (n), m."""
    given = parts(mechanism, theta)
    numbers = range(1, mechanism.n + 1)
    return ca.vertcat(
        *(_total([effect.length_drift(number, time, part) for effect, part in given]) for number in numbers)
    )


def compliances_at(mechanism: Mechanism, cables: Sequence[CableExpressions], theta: ca.SX) -> ca.SX:
    """Stretch of the cables (n) for a tension of 1 N/kg, m: l = l₀ + compliance · τ."""
    return _compliances(mechanism, cables, parts(mechanism, theta))


def seen_compliances_at(mechanism: Mechanism, cables: Sequence[CableExpressions], theta: ca.SX) -> ca.SX:
    """The part of `compliances_at` with which the encoders turn: their readings grow by it times the tension."""
    seen = [(effect, part) for effect, part in parts(mechanism, theta) if effect.encoder_sees_stretch]
    return _compliances(mechanism, cables, seen)


def stretch_dampings(mechanism: Mechanism, cables: Sequence[CableExpressions], theta: ca.SX) -> list[ca.SX]:
    """N s/m per kg against each cable's rate of stretch: Σ κ² c / (Σ κ)² of springs κ, dampers c in a row.

    Of slow motion: all have the same tension, so each takes its share κ of the stretch and of its rate.
    """
    found: list[ca.SX] = []
    for number, cable in enumerate(cables, start=1):
        yielding = [
            (compliance, effect.stretch_damping(number, part))
            for effect, part in parts(mechanism, theta)
            if not (compliance := effect.compliance(number, cable, part)).is_zero()
        ]
        if len(yielding) == 1:
            found.append(yielding[0][1] / mechanism.robot.mass)
            continue
        whole = sum((compliance for compliance, _ in yielding), ca.SX(0))
        felt = sum((compliance**2 * damping for compliance, damping in yielding), ca.SX(0))
        found.append(felt / whole**2 / mechanism.robot.mass if yielding else ca.SX(0))
    return found


def yieldings_at(mechanism: Mechanism, state: PlatformState, theta: ca.SX) -> ca.SX:
    """Wrenches (6 × n) per unit mass for each (N/kg)² of a tension whose entry point yields: ½ ∂κ, κ for 1 N/kg."""
    given = [(effect, part) for effect, part in parts(mechanism, theta) if effect.anchor_yields]
    columns: list[ca.SX] = []
    for number, cable in enumerate(state.cables, start=1):
        compliance = _total([effect.compliance(number, cable, part) for effect, part in given])
        half = mechanism.robot.mass / 2
        columns.append(ca.SX(6, 1) if compliance.is_zero() else half * state.gradient(compliance))
    return ca.horzcat(*columns)


def tension_wrenches_at(mechanism: Mechanism, state: PlatformState, theta: ca.SX) -> ca.SX:
    """Wrenches (6 × n) on the platform for each newton of the cables' tensions, or N/kg: both per unit mass."""
    given = _with_states(mechanism, state, theta)
    numbers = range(1, mechanism.n + 1)
    each = (sum((effect.tension_wrench(k, own, part) for own, effect, part in given), ca.SX(6, 1)) for k in numbers)
    return ca.horzcat(*each)


def extra_rates_at(mechanism: Mechanism, state: PlatformState, theta: ca.SX) -> ca.SX:
    """Time derivatives of all extra states."""
    found = (effect.extra_rates(own, part) for own, effect, part in _with_states(mechanism, state, theta))
    return ca.vertcat(ca.SX(0, 1), *found)


def extra_start_at(mechanism: Mechanism, state: PlatformState, theta: ca.SX) -> ca.SX:
    """All extra states at the start of a window, in the platform's state there."""
    found = (effect.extra_start(own, part) for own, effect, part in _with_states(mechanism, state, theta))
    return ca.vertcat(ca.SX(0, 1), *found)


def marker_at(mechanism: Mechanism, number: int, place: ca.SX, theta: ca.SX) -> ca.SX:
    """Where marker `number` (1-based), `place` in the robot file, really is in the body frame (3), m."""
    for effect, part in parts(mechanism, theta):
        place = effect.marker(number, place, part)
    return place


def stalks_at(mechanism: Mechanism, number: int, theta: ca.SX) -> list[Stalk]:
    """All that marker `number` (1-based) stands on and that gives way, one on the other."""
    found = (effect.stalk(number, part) for effect, part in parts(mechanism, theta))
    return [stalk for stalk in found if stalk is not None]


def seen_at(mechanism: Mechanism, point: ca.SX, state: PlatformState, theta: ca.SX) -> ca.SX:
    """What the cameras report for a point of the world (3), m."""
    for own, effect, part in _with_states(mechanism, state, theta):
        point = effect.seen(point, own, part)
    return point


def true_time_at(mechanism: Mechanism, stamp: ca.SX, theta: ca.SX) -> ca.SX:
    """When a frame with this stamp (s since the start of the window) was really taken, s."""
    for effect, part in parts(mechanism, theta):
        stamp = effect.true_time(stamp, part)
    return stamp


def _with_states(mechanism: Mechanism, state: PlatformState, theta: ca.SX) -> list[tuple[PlatformState, Effect, ca.SX]]:
    seen = states_of(mechanism, state)
    return [(own, effect, part) for own, (effect, part) in zip(seen, parts(mechanism, theta), strict=True)]


def _compliances(
    mechanism: Mechanism, cables: Sequence[CableExpressions], given: Sequence[tuple[Effect, ca.SX]]
) -> ca.SX:
    """m/N, times the mass."""
    numbered = enumerate(cables, start=1)
    each = [_total([effect.compliance(number, cable, part) for effect, part in given]) for number, cable in numbered]
    return mechanism.robot.mass * ca.vertcat(*each)


def _total(values: list[ca.SX]) -> ca.SX:
    return sum(values, ca.SX(0))
