"""How effects push the model, to first order: exact derivatives by θ alone, for scores of many effects at once.

Every effect rides on the same motion, so the variational equation of the *base* (state and body, without the scored
effects) is shared, and an effect adds one column of forcing for each θ. Three places, three functions:

    forcing      d[v̇; τ]/dθ at a state
    start_gaps   how θ changes what lengths and twist at a window's start must obey
    sightings    what the cameras see, and its derivatives by pose and θ

All take θ explicitly, with the scored effects at one of their scan points. `absent` names the entries of θ that are
known to be 0 (the amplitudes of scored effects): expressions shrink to those of the base, their derivatives stay.
Where a compliance is 0 (rigid base) everything here is exact; where the base itself stretches to first order, the
second-order coupling of two compliances is left out.
"""

from collections.abc import Sequence
from dataclasses import replace

import casadi as ca

from fidim_lab.model.batch import function, rows
from fidim_lab.model.geometry import skew
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion.contributions import marker_at, seen_at, stalks_at, true_time_at
from fidim_lab.model.motion.equations import MotionEquations, Symbols, motion_equations
from fidim_lab.model.slots import PlatformState


def forcing(mechanism: Mechanism, absent: Sequence[int] = ()) -> ca.Function:
    """(t, p, R row by row, twist, extra, χ′ 9, θ) → d[v̇; τ]/dθ row by row ((6 + n) × P), at fixed state and extra."""
    return mechanism.compiled(f"forcing {tuple(absent)}", lambda made: _compile_forcing(made, absent))


def start_gaps(mechanism: Mechanism, absent: Sequence[int] = ()) -> ca.Function:
    """What must vanish at the start of a window, beside its derivatives by θ at fixed pose and twist.

    Same inputs as `forcing` → lengths − drift − stretch (n), m: what ideal encoders read at zero tension; Ξ v − the
    rate of drift and stretch (n), m/s; their derivatives by θ, row by row (n × P each).
    """
    return mechanism.compiled(f"start gaps {tuple(absent)}", lambda made: _compile_start_gaps(made, absent))


def sightings(mechanism: Mechanism) -> ca.Function:
    """(stamp, p, R row by row, twist, extra, v̇ 6, θ) → markers as the cameras report them, marker by marker (3 M), m.

    The state is that at `true_time` of the stamp (second output, s). Stalks bend as in slow motion, without lag. Then
    the derivatives of the markers, row by row: by [δp; δθ_world] (3 M × 6) at the same v̇, by the extra states
    (3 M × extra), by θ (3 M × P) with what a later true time adds through the twist.
    """
    return mechanism.compiled("sightings", _compile_sightings)


def _pair(mechanism: Mechanism, absent: Sequence[int]) -> tuple[MotionEquations, MotionEquations]:
    """The equations with every θ, and those with zeros for the absent ones; the same symbols."""

    def make(made: Mechanism) -> tuple[MotionEquations, MotionEquations]:
        symbols = Symbols.of(made)
        base = replace(symbols, theta=_without(symbols.theta, absent))
        return motion_equations(made, symbols), motion_equations(made, base)

    return mechanism.compiled(f"equations with and without {tuple(absent)}", make)


def _without(theta: ca.SX, absent: Sequence[int]) -> ca.SX:
    """θ with zeros in these places."""
    return ca.vertcat(ca.SX(0, 1), *(0 if k in absent else theta[k] for k in range(theta.numel())))


def _at_base(expression: ca.SX, theta: ca.SX, absent: Sequence[int]) -> ca.SX:
    return ca.substitute(expression, theta, _without(theta, absent))


def _compile_forcing(mechanism: Mechanism, absent: Sequence[int]) -> ca.Function:
    equations, base = _pair(mechanism, absent)
    solver, theta = base.factorised(), equations.symbols.theta
    solution = solver(base.wrench, base.pull)
    given = ca.SX.sym("solution", 6 + mechanism.n)
    rates, held = given[:6], given[6:]
    left = ca.vertcat(
        equations.mass @ rates + equations.pulling @ held - equations.by_square @ held**2 - equations.wrench,
        equations.structure @ rates - equations.pull,
    )
    by_theta = ca.substitute(_at_base(ca.jacobian(left, theta), theta, absent), given, solution)
    if not equations.compliance.is_zero():
        by_theta[6:, :] -= _at_base(_stretch_by_theta(equations, base, solution)[2], theta, absent)
    moved = solver(-by_theta[:6, :], -by_theta[6:, :])
    return function("forcing", equations.symbols.inputs, ca.cse([rows(moved)]))


def _compile_start_gaps(mechanism: Mechanism, absent: Sequence[int]) -> ca.Function:
    equations, base = _pair(mechanism, absent)
    theta, twist = equations.symbols.theta, equations.symbols.twist
    lengths = equations.lengths - equations.drifts
    speeds = equations.structure @ twist - ca.jtimes(equations.drifts, equations.symbols.time, ca.SX(1))
    found = [lengths, speeds, ca.jacobian(lengths, theta), ca.jacobian(speeds, theta)]
    if not equations.compliance.is_zero():
        solver = base.factorised()
        rigid = solver(base.wrench, base.pull)
        if not base.compliance.is_zero():
            found[0], found[1] = (gap - part for gap, part in zip(found[:2], base.stretch(solver), strict=False))
        stretched = _stretch_by_theta(equations, base, rigid)
        found[2], found[3] = found[2] - stretched[0], found[3] - stretched[1]
    outputs = [rows(_at_base(part, theta, absent)) for part in found]
    return function("start_gaps", equations.symbols.inputs, ca.cse(outputs))


def _stretch_by_theta(equations: MotionEquations, base: MotionEquations, rigid: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """d/dθ of stretch κ τ and of its first two derivatives in time (n × P each), τ taken as it is in the base."""
    theta, rates, held = equations.symbols.theta, rigid[:6], rigid[6:]
    changing = base.along(held, rates)
    bending = base.along(changing, rates)
    # κ̈ along the motion: v̇ is what it is, not a function of the state to be differentiated once more
    still = ca.SX.sym("rates", 6)
    growing = equations.along(equations.compliance, still)
    bent = equations.along(growing, still)
    by, by_rate, by_bend = (
        ca.substitute(ca.jacobian(part, theta), still, rates) for part in (equations.compliance, growing, bent)
    )
    tension, rate, bend = (ca.repmat(part, 1, theta.numel()) for part in (held, changing, bending))
    return by * tension, by_rate * tension + by * rate, by_bend * tension + 2 * by_rate * rate + by * bend


def _compile_sightings(mechanism: Mechanism) -> ca.Function:
    symbols = Symbols.of(mechanism)
    stamp, theta = ca.SX.sym("stamp"), symbols.theta
    time = true_time_at(mechanism, stamp, theta)
    state = PlatformState(
        time=symbols.time,
        position=symbols.position,
        rotation=symbols.rotation,
        twist=symbols.twist,
        cables=mechanism.cables_at(symbols.position, symbols.rotation, theta),
        extra=symbols.extra,
    )
    places = (ca.SX(ca.DM(place)) for place in mechanism.robot.markers)
    accelerations, gravity = ca.SX.sym("accelerations", 6), ca.SX(ca.DM(mechanism.robot.gravity))

    def point(number: int, place: ca.SX) -> ca.SX:
        arm, spin = symbols.rotation @ marker_at(mechanism, number, place, theta), symbols.twist[3:]
        swept = ca.cross(accelerations[3:], arm) + ca.cross(spin, ca.cross(spin, arm))
        give = sum((stalk.give for stalk in stalks_at(mechanism, number, theta)), ca.SX(3, 3))
        felt = symbols.rotation.T @ (gravity - accelerations[:3] - swept)
        return symbols.position + arm + symbols.rotation @ give @ felt

    points = (point(number, place) for number, place in enumerate(places, start=1))
    seen = ca.vertcat(*(seen_at(mechanism, one, state, theta) for one in points))
    turned = ca.jacobian(seen, symbols.flat) @ _turned(symbols.rotation)
    by_pose = ca.horzcat(ca.jacobian(seen, symbols.position), turned)
    later = by_pose @ symbols.twist + ca.jacobian(seen, symbols.time)
    by_theta = ca.jacobian(seen, theta) + later @ ca.jacobian(time, theta)
    outputs = [seen, rows(by_pose), rows(ca.jacobian(seen, symbols.extra)), rows(by_theta)]
    at_time = [ca.substitute(output, symbols.time, time) for output in outputs]
    inputs = [stamp, symbols.position, symbols.flat, symbols.twist, symbols.extra, accelerations, theta]
    return function("sightings", inputs, [at_time[0], time, *at_time[1:]])


def _turned(rotation: ca.SX) -> ca.SX:
    """d(rotation row by row)/dδθ (9 × 3) for R → exp([δθ]×) R."""
    axes = (ca.SX(ca.DM.eye(3)[:, axis]) for axis in range(3))
    return ca.horzcat(*(rows(skew(axis) @ rotation) for axis in axes))
