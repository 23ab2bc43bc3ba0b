"""Sentences on an unknown wrench, from its family and its samples along the motion."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from fidim_lab.mismatch.thresholds import SHARED
from fidim_lab.mismatch.unknown_force.evidence import Weighed
from fidim_lab.mismatch.unknown_force.family import Dependence
from fidim_lab.mismatch.unknown_force.field import Field
from fidim_lab.mismatch.unknown_force.latent import LatentForce
from fidim_lab.mismatch.unknown_force.points import ForcePoint
from fidim_lab.mismatch.unknown_force.thresholds import UNKNOWN_FORCE


def words(
    latent: LatentForce, theta: Float[np.ndarray, " r"], field: Field, ranking: Sequence[Weighed]
) -> tuple[str, ...]:
    """Sentences, the most telling first. field: of this latent force alone; ranking: it first, then the others."""
    if latent.family is None:
        return ()
    found = [_telling(latent, theta, field)]
    found.append(_size(field))
    found.append(_energy(field))
    best = ranking[0] if ranking else None
    least = 0.0 if best is None else max(0.0, SHARED.nearly_all * best.left_out)
    alike = [one.family.label for one in ranking[1:] if one.left_out > least]
    if alike:
        found.append(f"About as good or better on windows left out: {', '.join(alike[:3])}.")
    return tuple(sentence for sentence in found if sentence)


def _telling(latent: LatentForce, theta: np.ndarray, field: Field) -> str:
    family, shape = latent.family, latent.shape_at(theta)
    if family is None:
        return ""
    match family.dependence:
        case Dependence.CENTRE:
            return _centre(latent, theta, field)
        case Dependence.POSITION:
            return _somewhere(field, "It pushes differently in different places")
        case Dependence.GRADIENT:
            return _gradient(latent, theta, field)
        case Dependence.BRAKE:
            return _brake(latent, shape, field)
        case Dependence.SPEED:
            return f"It goes along with the velocity and grows with {_power('speed', family.power)}."
        case Dependence.VELOCITY:
            return "It depends on the velocity, and not by one power of the speed."
        case Dependence.SPIN:
            return f"A torque that grows with the {_power('rate of turning', family.power)}: none while nothing turns."
        case Dependence.ACROSS:
            momentum = ", ".join(f"{x:.2g}" for x in latent.weights(theta))
            return f"It acts across the rotation, like a wheel that spins inside with ({momentum}) N m s, body frame."
        case Dependence.TURNING:
            law = _power("rate of turning", family.power)
            return f"It acts only while the platform turns, and grows with the {law} ({family.label})."
        case Dependence.ORIENTATION:
            return "A torque that depends on how the platform is turned, not on its motion."
        case Dependence.MOMENT:
            return _moment(shape, field)
        case Dependence.TIME:
            return _course(field)
        case Dependence.PERIODIC:
            return _repeats(latent, theta, float(shape[0]))
        case Dependence.DETENT:
            return f"It comes back {shape[0]:.3g} times in one turn, as {family.label} would."
        case Dependence.CABLE:
            return f"It acts only at cable {family.cable}: {family.label}{_law(latent, theta)}."


def _repeats(latent: LatentForce, theta: np.ndarray, f: float) -> str:
    """How often and, of knocks, how strong: their impulse is what motion tells, hardly how short they are."""
    own = latent.family is not None and latent.family.harmonics > 0
    when = "at a time of its own in each window" if own else "in step in all windows"
    said = f"every {1 / f:.3g} s ({f:.3g} Hz), {when}"
    if latent.family is None or not latent.family.knocks:
        return f"It repeats {said}."
    mean = latent.weights(theta).reshape(3, -1)[:, 0]
    impulse = ", ".join(f"{x:.2g}" for x in mean / f)
    return f"It knocks {said}, by ({impulse}) N s each time."


def _power(rate: str, power: float | None) -> str:
    if power is None or power == 1:
        return rate
    return f"{rate}{ {2.0: '²', 3.0: '³', 4.0: '⁴'}.get(power, f' to the power {power:g}') }"


def _centre(latent: LatentForce, theta: np.ndarray, field: Field) -> str:
    if latent.family is None:
        return ""
    shape = latent.shape_at(theta)
    centre, width = shape[:3], float(np.exp(shape[3]))
    near, wide = latent.weights(theta)
    on_p = _on_p(latent)
    places = field.places if on_p else field.centres
    nearest = float(np.linalg.norm(places - centre, axis=1).min())
    r = np.linspace(0.0, max(6 * width, nearest + 2 * width), 400)
    course = r * (near * np.exp(-((r / width) ** 2) / 2) + wide * np.exp(-((r / width) ** 2) / 8))
    seen = r >= nearest
    k = int(np.argmax(np.where(seen, np.abs(course), 0.0)))
    half = r[seen & (np.abs(course) >= np.abs(course[k]) / 2)].max()
    point = ", ".join(f"{x:.2f}" for x in centre)
    way = "towards" if course[k] > 0 else "away from"
    body = "P" if on_p else "the centre of mass"
    said = f"It pushes {body} {way} ({point}) m: {abs(course[k]):.2g} N at {r[k]:.2f} m from there, half of it within "
    said += f"{half:.2f} m"
    return said + (f" (no window came nearer than {nearest:.2f} m)." if nearest > width else ".")


def _on_p(latent: LatentForce) -> bool:
    """Whether it acts at P, and not at the centre of mass."""
    return latent.family is not None and latent.family.point is ForcePoint.REFERENCE


def _brake(latent: LatentForce, shape: np.ndarray, field: Field) -> str:
    body = "P" if _on_p(latent) else "the centre of mass"
    if not len(shape):
        return _somewhere(field, f"It goes along with the velocity of {body}, in some places more than in others")
    point = ", ".join(f"{x:.2f}" for x in shape[:3])
    places, velocities = field.centres, field.velocities
    if _on_p(latent):
        places, velocities = field.places, velocities - np.cross(field.spins, field.centres - field.places)
    speed2 = (velocities**2).sum(axis=1)
    strength = -(field.forces * velocities).sum(axis=1) / np.maximum(speed2, 1e-3 * speed2.max())
    k = int(np.argmax(np.abs(strength)))
    way = "opposes" if strength[k] > 0 else "drives"
    far = float(np.linalg.norm(places[k] - shape[:3]))
    said = f"It {way} the motion of {body} near ({point}) m and not elsewhere: "
    return said + f"up to {abs(strength[k]):.2g} N s/m, {far:.2f} m from there."


def _gradient(latent: LatentForce, theta: np.ndarray, field: Field) -> str:
    """For a linear field its stiffness; else where it is largest."""
    weights = latent.weights(theta)
    if latent.family is None or latent.family.scale is None or len(weights) != 3 * 4:
        return _somewhere(field, "It changes smoothly with the place")
    stiffness = weights.reshape(3, 4)[:, 1:] / latent.family.scale
    along = 0.5 * (stiffness + stiffness.T)
    values, vectors = np.linalg.eigh(along)
    most = float(np.abs(values).max())
    said = "; ".join(
        f"along ({_direction(vectors[:, k])}) it pushes "
        f"{'back, like a spring' if values[k] < 0 else 'away, more the farther it goes'}, {abs(values[k]):.2g} N/m"
        for k in np.argsort(-np.abs(values))
        if abs(values[k]) > UNKNOWN_FORCE.words_clearly * most
    )
    turning = float(np.linalg.norm(stiffness - along) / max(float(np.linalg.norm(stiffness)), 1e-300))
    potential = (
        f"{turning:.0%} of it has no potential" if turning > UNKNOWN_FORCE.words_clearly else "it has a potential"
    )
    return f"It grows in proportion to the place: {said}; {potential}."


def _direction(axis: Float[np.ndarray, " 3"]) -> str:
    """Of a unit vector of which the sign does not matter: its largest component is positive."""
    axis = axis * np.sign(axis[np.argmax(np.abs(axis))])
    return ", ".join(f"{x:z.2f}" for x in axis)


def _somewhere(field: Field, begin: str) -> str:
    size = np.linalg.norm(field.forces, axis=1)
    k = int(np.argmax(size))
    place = ", ".join(f"{x:.2f}" for x in field.centres[k])
    way = ", ".join(f"{x:.2g}" for x in field.forces[k])
    return f"{begin}: most at ({place}) m, there ({way}) N, at the centre of mass."


def _moment(shape: np.ndarray, field: Field) -> str:
    middle, width = float(shape[0]), float(np.exp(shape[1]))
    k = int(np.argmax(np.linalg.norm(field.forces, axis=1)))
    way = ", ".join(f"{x:.2g}" for x in field.forces[k])
    begin = max(0.0, middle - 2 * width)
    return f"It acts between {begin:.2f} and {middle + 2 * width:.2f} s after the release, in all windows: ({way}) N."


def _course(field: Field) -> str:
    size = np.linalg.norm(np.hstack([field.forces, field.torques]), axis=1)
    order = np.argsort(field.t)
    share = np.cumsum(size[order] ** 2) / max(float((size**2).sum()), 1e-300)
    begin, end = (float(field.t[order][np.searchsorted(share, x)]) for x in (0.1, 0.9))
    return f"It depends on the time since the release; 80 % of it between {begin:.1f} and {end:.1f} s."


def _law(latent: LatentForce, theta: np.ndarray) -> str:
    """Which of a joint's laws weighs most."""
    names = ("its rate", "the sign of its rate", "its rate³", "its angle", "its angle", "the sign of its rate")
    weights = np.abs(latent.weights(theta))
    return f", mostly with {names[int(np.argmax(weights))]}" if len(weights) == len(names) else ""


def _size(field: Field) -> str:
    force, torque = (np.linalg.norm(x, axis=1) for x in (field.forces, field.torques))
    parts: list[str] = []
    if force.max() > 0:
        parts.append(f"force {np.sqrt(np.mean(force**2)):.2g} N rms, at most {force.max():.2g} N")
    if torque.max() > 1e-3 * force.max():
        parts.append(f"torque {np.sqrt(np.mean(torque**2)):.2g} N m rms, at most {torque.max():.2g} N m")
    return f"Its size along the motion: {'; '.join(parts)}." if parts else ""


def _energy(field: Field) -> str:
    power = field.power
    size = float(np.mean(np.abs(power)))
    mean = float(np.mean(power))
    if size == 0:
        return ""
    if mean < -UNKNOWN_FORCE.words_clearly * size:
        return f"It takes energy from the motion: {-mean:.2g} W on average."
    if mean > UNKNOWN_FORCE.words_clearly * size:
        return f"It feeds energy into the motion: {mean:.2g} W on average."
    return "It takes about as much energy from the motion as it gives."
