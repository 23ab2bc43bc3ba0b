"""Is a robot file plausible? It may read well and still hold millimetres, an inertia in kg m², or no place to rest.

`plausibility` gives one `RobotFinding` a check, in the order in which a person would look: units first, and nothing
further where those are wrong. One that is fine and still has advice is a warning: such a robot exists, but mind this.
"""

import numpy as np

from fidim_lab.app.doctor.robot_findings import (
    RobotFinding,
    copies,
    order,
    pulleys,
    roll,
    uncertainties,
    what_would_rest,
)
from fidim_lab.data.records import Robot
from fidim_lab.errors import FidimError, InfeasibleError
from fidim_lab.identification.equations.consistency import can_exist
from fidim_lab.identification.random_plan import PENDULUM
from fidim_lab.identification.workspace import Workspace, rest_near
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.modes import ROTATION_SCALE, modes, scaled_singular_values
from fidim_lab.model.statics import Equilibrium
from fidim_lab.say import counted
from fidim_lab.units import HALL

LARGEST_PULLEY = 0.5
"""m"""
REACH = 1.0
"""m from P within which attachments and markers of such platforms lie"""
ASIDE = 2.0
"""of their spread, by which the middle of the attachments may be away from P: a corner of the platform is 1 away"""
GYRATION = 1.5
"""of the platform's reach from G: no body has a larger radius of gyration than its farthest point"""
USUAL, FEWEST = 0.7, 0.1
"""usual radius of gyration over that reach, and the part of it below which no unit is guessed: it is advice"""
DEPTHS = np.linspace(0.3, 1.0, 8)
"""under the middle of the anchors, in the workspace's scale"""
SOFT = 0.1
"""smallest scaled singular value over the next below which cables must not be taken as rigid (spec/irma4u.md §6)"""
STRETCH = 3e-4
"""m, for the example in the soft modes' sentence"""
MARKER_RATE = 100.0
"""Hz"""
STOP_BAND = 10.0
"""Hz, of the low-pass before differentiation (§5.2)"""
SLOWEST = 0.2
"""Hz: two swings in a window of 10 s"""
EARTH = (9.77, 9.84)
"""m/s², from the equator's mountains to the poles, with a margin of 0.01"""
NEUTRAL = 1e-3
"""Hz"""


def plausibility(robot: Robot) -> list[RobotFinding]:
    """All checks of a robot that has been read. Raises nothing: what cannot be computed is a finding."""
    if not (first := units(robot)).ok:
        return [first]
    findings = [first, attachments(robot), copies(robot), roll(robot), inertia(robot), body(robot), weight(robot)]
    findings.append(uncertainties(robot))
    mechanism = Mechanism(robot)
    rests = middle_rests(mechanism)
    findings.append(rest(robot, rests))
    if rests:
        findings += [order(robot, rests), pulleys(mechanism, rests), soft_modes(mechanism, rests)]
    if rests and can_exist(robot.nominal):
        findings.append(frequencies(mechanism, rests))
    return findings


def units(robot: Robot) -> RobotFinding:
    """Metres, not millimetres."""
    sizes: dict[str, float] = {"platform, marker": _largest(robot.markers)}
    for number, cable in enumerate(robot.cables, start=1):
        sizes[f"cable {number}, d"], sizes[f"cable {number}, a"] = _largest(cable.d), _largest(cable.a)
    sizes["platform, nominal_com"] = _largest(robot.nominal.com)
    key = max(sizes, key=lambda name: sizes[name])
    if sizes[key] > HALL:
        found = f"{key.capitalize()} holds {sizes[key]:g}, which would be metres."
        return RobotFinding("units", False, found, "Lengths are in metres: divide millimetres by 1000, everywhere.")
    number, radius = max(enumerate((cable.radius for cable in robot.cables), start=1), key=lambda item: item[1])
    if radius > LARGEST_PULLEY:
        found = f"Cable {number}, radius is {radius:g} m."
        return RobotFinding("units", False, found, "Pulley radii are in metres, as everything: 25 mm is 0.025.")
    return RobotFinding("units", True, f"The largest coordinate is {sizes[key]:.3g} m ({key}): metres.")


def attachments(robot: Robot) -> RobotFinding:
    """Attachment points and markers near P, in the body frame and not in the world's."""
    reach = {f"attachment of cable {k}": float(np.linalg.norm(c.a)) for k, c in enumerate(robot.cables, start=1)}
    reach |= {f"marker {k}": float(np.linalg.norm(m)) for k, m in enumerate(robot.markers, start=1)}
    key = max(reach, key=lambda name: reach[name])
    found = f"The farthest point of the platform is the {key}, {reach[key]:.3f} m from P."
    if reach[key] <= REACH:
        return RobotFinding("attachments", True, found)
    frame, wide = (_spread(np.array([getattr(cable, key) for cable in robot.cables])) for key in ("d", "a"))
    aside = float(np.linalg.norm(np.mean([cable.a for cable in robot.cables], axis=0)))
    advice = "a and markers are in the body frame, from P, in metres; a platform wider than a metre is unusual."
    if reach[key] <= frame and aside <= ASIDE * wide:
        return RobotFinding("attachments", True, found, advice)
    found += (
        f" The anchors (d) lie within {frame:.3f} m of their middle, that of the attachments is {aside:.3f} m from P."
    )
    return RobotFinding("attachments", False, found, advice)


def inertia(robot: Robot) -> RobotFinding:
    """Inertia per unit mass: no radius of gyration beyond the body."""
    com = robot.nominal.com
    reach = max(float(np.linalg.norm(point - com)) for point in (*(c.a for c in robot.cables), *robot.markers))
    moment = float(np.linalg.eigvalsh(robot.nominal.inertia_about_com)[-1])
    gyration = float(np.sqrt(max(moment, 0.0)))
    found = (
        f"The largest radius of gyration about G is {gyration:.3f} m; the attachments and markers reach {reach:.3f} m."
    )
    if gyration <= GYRATION * reach:
        return RobotFinding("inertia", True, found)
    advice = "nominal_inertia is per unit mass, in m², about P. " + _in_other_units(gyration, reach, robot.mass)
    return RobotFinding("inertia", False, found, advice)


def _in_other_units(gyration: float, reach: float, mass: float) -> str:
    """The unit in which the radius of gyration would be one of this body."""
    units = {"kg m²": mass, "kg mm²": mass * 1e6, "mm² per unit mass": 1e6, "g mm²": mass * 1e9}
    would = {name: gyration / np.sqrt(factor) / reach for name, factor in units.items()}
    name = min(would, key=lambda unit: abs(np.log(would[unit] / USUAL)))
    if FEWEST * USUAL < would[name] <= GYRATION:
        return f"It looks like {name}: divide it by {units[name]:g}, and that radius is {would[name] * reach:.3f} m."
    return f"Divide kg m² by the mass ({mass:g} kg), kg mm² by {1e6 * mass:g}."


def body(robot: Robot) -> RobotFinding:
    """A positive definite pseudo-inertia."""
    moments = np.linalg.eigvalsh(robot.nominal.inertia_about_com)
    shown = ", ".join(f"{moment:.4g}" for moment in moments)
    if can_exist(robot.nominal):
        return RobotFinding(
            "body", True, f"The nominal body can exist: principal moments about G {shown} m² per unit mass."
        )
    why = "one is not positive" if moments[0] <= 0 else "the largest is not below the sum of the others"
    found = f"No body has these parameters: principal moments about G {shown} m² per unit mass, {why}."
    advice = "nominal_inertia is about P, not about G, and per unit mass; its order is xx yy zz xy xz yz."
    return RobotFinding("body", False, found, advice)


def weight(robot: Robot) -> RobotFinding:
    """Tension limits that can carry the platform."""
    pull = robot.mass * float(np.linalg.norm(robot.gravity))
    low, high = robot.limits.tension
    cables = counted(robot.n, "cable")
    found = f"{robot.mass:g} kg weigh {pull:.1f} N; limits.tension is {low:g} to {high:g} N for each of {cables}."
    if robot.n * high <= pull:
        return RobotFinding(
            "weight", False, found, "All cables together cannot carry it: check mass and limits.tension."
        )
    if low >= pull:
        advice = "Each cable would have to pull with more than the whole weight: check mass and limits.tension (N)."
        return RobotFinding("weight", False, found, advice)
    return RobotFinding("weight", True, found, _unusual_gravity(robot))


def _unusual_gravity(robot: Robot) -> str:
    """What to look at where gravity is not that of a frame whose upward axis counts upwards, on Earth."""
    size, axis = float(np.linalg.norm(robot.gravity)), int(np.abs(robot.gravity).argmax())
    if not EARTH[0] <= size <= EARTH[1]:
        return f"gravity is {size:g} m/s²; on Earth it is 9.78 to 9.83."
    if robot.gravity[axis] > 0:
        name = "xyz"[axis]
        return f"gravity points along +{name}: right only where {name} counts downwards in all coordinates."
    return ""


def middle_rests(mechanism: Mechanism) -> list[Equilibrium]:
    """Rest poses at several depths under the middle of the anchors, with three cables or more within the limits."""
    workspace = Workspace(mechanism.robot)
    rests: list[Equilibrium] = []
    for hung in (False, True) if mechanism.n == PENDULUM else (False,):
        for depth in () if rests else DEPTHS:
            try:
                rests.append(rest_near(mechanism, workspace.place(np.zeros(3), float(depth)), hung=hung))
            except InfeasibleError:
                continue
    return rests


def rest(robot: Robot, rests: list[Equilibrium]) -> RobotFinding:
    """Rest poses within the tension limits."""
    low, high = robot.limits.tension
    held = [tension for r in rests for tension in [r.tensions_in_newton(robot.mass)]]
    good = [tension.min() >= low and tension.max() <= high for tension in held]
    tried = f"{len(DEPTHS)} depths under the middle of the anchors"
    advice = "" if all(good) and held else what_would_rest(robot)
    if any(good):
        place = [r.marker_position(robot.marker)[2] for r, ok in zip(rests, good, strict=True) if ok]
        found = (
            f"At {sum(good)} of {tried} the platform rests with all tensions within {low:g} to {high:g} N "
            f"(marker at z = {min(place):.2f} to {max(place):.2f} m)."
        )
        return RobotFinding("rest", True, found, advice)
    advice = advice or "Check d and a (world and body frame), order of the cables, gravity, mass and limits.tension."
    if not held:
        return RobotFinding(
            "rest", False, f"At none of {tried} the platform rests with taut cables in their limits.", advice
        )
    closest = min(held, key=lambda tension: max(low - tension.min(), tension.max() - high))
    found = (
        f"At none of {tried} it rests with all tensions within {low:g} to {high:g} N; "
        f"nearest are {closest.min():.1f} to {closest.max():.1f} N."
    )
    return RobotFinding("rest", False, found, advice)


def soft_modes(mechanism: Mechanism, rests: list[Equilibrium]) -> RobotFinding:
    """How firmly the cables hold the platform: the smallest scaled singular value of Ξ against the next."""
    values = scaled_singular_values(
        mechanism.structure_matrix(
            np.array([r.pose.position for r in rests]), np.array([r.pose.rotation for r in rests])
        )
    )
    if mechanism.n == 1:
        return RobotFinding("soft modes", True, "A single cable has no soft mode.")
    worst = values[int(np.argmin(values[:, -1] / values[:, -2]))]
    ratio = worst[-1] / worst[-2]
    found = f"Smallest scaled singular values of Ξ: {worst[-1]:.2g} and {worst[-2]:.2g} (ratio {ratio:.2f})."
    if ratio >= SOFT:
        return RobotFinding("soft modes", True, found)
    lever = max(float(worst[-1]) * ROTATION_SCALE, 1e-6)
    turn = np.degrees(STRETCH / lever)
    size = f"about {turn:.0f}°" if turn < 90 else "freely"
    found += f" The platform can nearly move in a further direction: {STRETCH * 1e3:.1f} mm of stretch turns it {size}."
    advice = (
        "Rigid cables are the wrong model here; use elastic cables. Wider attachments or crossed cables would make the "
        "platform stiffer."
    )
    return RobotFinding("soft modes", True, found, advice)


def frequencies(mechanism: Mechanism, rests: list[Equilibrium]) -> RobotFinding:
    """Mode frequencies against the marker rate and the low-pass."""
    what, nominal = "frequencies", mechanism.robot.nominal
    try:
        found_modes = np.concatenate([modes(mechanism, nominal, r).frequencies for r in rests])
    except FidimError as error:
        return RobotFinding(what, False, error.message, error.hint)
    swinging = found_modes[found_modes > NEUTRAL]
    if not len(swinging):
        return RobotFinding(
            what, False, "No freedom of the platform swings: nothing can be identified.", "Check d and a."
        )
    slow, fast = float(swinging.min()), float(swinging.max())
    found = (
        f"Modes from {slow:.2f} to {fast:.2f} Hz: at least {MARKER_RATE / fast:.0f} samples per period at "
        f"{MARKER_RATE:g} Hz; the low-pass filter stops {STOP_BAND:g} Hz."
    )
    if fast >= STOP_BAND:
        advice = "The low-pass removes the fastest mode: total least squares cannot see it. Check inertia and geometry."
        return RobotFinding(what, False, found, advice)
    if 2 * fast >= STOP_BAND:
        advice = "The harmonics of the fastest mode reach the low-pass: prefer methods that do not filter (mle)."
    elif slow < SLOWEST:
        advice = "The slowest mode makes less than two swings in 10 s: record longer windows."
    elif len(swinging) < len(found_modes):
        advice = "A freedom has no restoring force (it turns freely): the inertia about it is seen only while it turns."
    else:
        advice = ""
    return RobotFinding(what, True, found, advice)


def _largest(values: np.ndarray) -> float:
    return float(np.abs(values).max())


def _spread(points: np.ndarray) -> float:
    """Largest distance from their mean, m."""
    return float(np.linalg.norm(points - points.mean(axis=0), axis=1).max())
