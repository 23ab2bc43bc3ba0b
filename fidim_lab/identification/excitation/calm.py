"""Bringing the platform to rest with the winches: strokes that cancel the measured swing.

The same strokes that excite a mode take its swing away when they come in the opposite phase. One chain at a time, on
the mode that swings most; then one looks again. What is left of a swing after a chain is some tenth of it. A stroke
begins while the platform swings: what tensions come of both is looked at by the nonlinear model before anything moves.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float

from fidim_lab.arrays import PerCable
from fidim_lab.data.records import Body, Pose
from fidim_lab.errors import InfeasibleError, OurBugError
from fidim_lab.identification.excitation.candidates import DUTY, SPARE
from fidim_lab.identification.excitation.motion import at_rest, line_of, wider
from fidim_lab.identification.excitation.place import MASS_OFF, ExcitationPlace, WinchLimits, inside
from fidim_lab.identification.excitation.strokes import COARSE, Chain, Pattern
from fidim_lab.model.geometry import rotation_matrix
from fidim_lab.model.motion import driven_motions
from fidim_lab.model.statics import balance
from fidim_lab.model.swing import Swing

TURNS = (1, 2, 3, 4, 6, 8, 12)
SHARES = (1.0, 0.6, 0.36, 0.2, 0.1, 0.05)
"""of what the winches may do, tried until tensions keep their limits"""
WORSE = 0.03
"""of what tensions may span: by so much may strokes pull beyond a swing that breaks limits by itself"""
WILD = 0.4
"""times the lower limit, down to which a swing by itself may pull cables for strokes to be added; the upper over it"""
ROUNDS, EXACT = 8, 1e-9
"""of Newton's method towards a pose on the cables; m"""
AFTER = 1.0
"""s after the last stroke whose tensions are looked at"""
SELECTIVE = 30.0
"""how much a direction minds moving other modes"""
GENTLE = 0.6
"""part of the acceleration allowed: a calming stroke must not pull cables slack"""


@dataclass(frozen=True, eq=False)
class Calming:
    """A chain, and when its first stroke is to begin."""

    chain: Chain
    begin: float
    """s, on the clock of the marker's samples"""
    mode: int
    left: Float[np.ndarray, " modes"]
    """m: how far the marker swings in each mode afterwards, by linear theory"""

    @property
    def end(self) -> float:
        """s, when the last stroke ends."""
        return self.begin + self.chain.pattern.seconds


def calmed(
    place: ExcitationPlace,
    swing: Swing,
    states: Complex[np.ndarray, " modes"],
    t: float,
    earliest: float,
    limits: WinchLimits | None = None,
    bodies: Sequence[Body] = (),
) -> Calming:
    """The chain that takes most of the swing away, and leaves no tension limit on the way.

    swing: with damping and frequencies as seen. states: y at time t (s). earliest: s, when the first stroke may begin.
    bodies: others than the place's that may hang there; each is looked at by itself. Raises InfeasibleError where even
    small strokes break a tension limit that the swing by itself keeps, and where it swings too wildly for any.
    """
    limits = limits or WinchLimits()
    allowed: list[tuple[float, float]] | None = None
    pulls: list[tuple[float, float]] = []
    for share in SHARES:
        found = _most(place, swing, states, t, earliest, limits, share)
        now = states * np.exp(swing.rates * (found.begin - t))
        if allowed is None:
            allowed = [_allowed(place, one) for one in _pulls(place, swing, now, found.chain.scaled(0.0), bodies)]
        pulls = _pulls(place, swing, now, found.chain, bodies)
        if all(low <= least and most <= high for (low, high), (least, most) in zip(allowed, pulls, strict=True)):
            return found
    least, most = min(low for low, _ in pulls), max(high for _, high in pulls)
    pulled = "slack" if least <= 0 else f"by {least:.1f} to {most:.1f} N"
    low, high = inside(place.robot.limits.tension)
    raise InfeasibleError(
        f"Strokes that calm the platform here would pull cables {pulled}; {low:.1f} to {high:.1f} N is allowed, "
        f"{100 * MASS_OFF:g} % kept for a mass that is off.",
        hint="Let it come to rest by itself, or choose an equilibrium farther from the tension limits.",
    )


def _allowed(place: ExcitationPlace, alone: tuple[float, float]) -> tuple[float, float]:
    """What strokes may pull (N) where a body that swings by itself pulls so.

    A swing that breaks a limit by itself may be calmed by strokes that make it hardly worse; one in which cables come
    near to being slack, or which cannot be followed at all, is left alone.
    """
    low, high = inside(place.robot.limits.tension)
    if not (WILD * low <= alone[0] and alone[1] <= high / WILD):
        pulls = "slack" if alone[0] <= 0 else f"by {alone[0]:.1f} to {alone[1]:.1f} N"
        raise _too_wild(f"by itself it pulls cables {pulls}")
    spare = WORSE * (high - low)
    return min(low, max(alone[0] - spare, WILD * low)), max(high, min(alone[1] + spare, high / WILD))


def _pulls(
    place: ExcitationPlace, swing: Swing, states: np.ndarray, chain: Chain, bodies: Sequence[Body]
) -> list[tuple[float, float]]:
    """Smallest and largest tension (N) of a chain that begins with the modes in these states, of each body."""
    line = line_of((chain,), AFTER, COARSE)
    pose, twist = _on_its_cables(place, *swing.motion(states))
    pull = line.accelerations(chain.direction[np.newaxis])[np.newaxis]
    ends = at_rest(place, (chain,))
    found: list[tuple[float, float]] = []
    for body in (place.body, *bodies):
        motion = driven_motions(place.mechanism, body, pose, pull, line.steps, swing.damping_matrix(), twist)
        found.append(wider(ends, place.robot.mass * motion.tensions))
    return found


def _on_its_cables(
    place: ExcitationPlace, pose: Pose, twist: Float[np.ndarray, "6"]
) -> tuple[Pose, Float[np.ndarray, "6"]]:
    """The nearest pose at which cables are as long as they are held, and the twist with which they stay so.

    Modes are straight lines in the space of poses, which leave the cables by millimetres where the platform swings by
    centimetres: a simulation from there begins with hundreds of newtons that nothing pulls with. Raises InfeasibleError
    where there is no such pose nearby.
    """
    held = place.equilibrium
    for _ in range(ROUNDS):
        _, _, xi, lengths = balance(place.mechanism, place.body, pose, held.tensions)
        back = np.linalg.pinv(xi)
        if np.abs(held.lengths - lengths).max() < EXACT:
            return pose, twist - back @ (xi @ twist)
        step = back @ (held.lengths - lengths)
        pose = Pose(position=pose.position + step[:3], rotation=rotation_matrix(step[3:] / 2) @ pose.rotation)
    raise _too_wild("no pose on its cables fits what is seen")


def _too_wild(why: str) -> InfeasibleError:
    return InfeasibleError(
        f"The platform swings so wildly that {why}: no strokes are added to that.",
        hint="Let it fade, and resume the run when it hangs still.",
    )


def _most(
    place: ExcitationPlace,
    swing: Swing,
    states: np.ndarray,
    t: float,
    earliest: float,
    limits: WinchLimits,
    share: float,
) -> Calming:
    """The chain that takes most away with this share of what the winches may do; tensions are not looked at."""
    omega = np.abs(np.imag(swing.rates))
    mode = int(np.argmax(swing.amplitudes(states)))
    best: Calming | None = None
    for turns in TURNS:
        pattern = Pattern(np.pi / omega[mode], turns, DUTY)
        response = pattern.response(swing.rates) * swing.dragged
        direction = _direction(swing, mode, np.abs(response))
        most = (share * SPARE) * min(
            limits.reach(place.equilibrium.lengths, direction),
            limits.speed / pattern.speed,
            GENTLE * limits.acceleration / pattern.acceleration,
        )
        found = _timed(swing, mode, states, t, earliest, pattern, response, direction, most)
        if best is None or _whole(found.left) < 0.9 * _whole(best.left):
            best = found
        if _whole(found.left) < 0.15 * _whole(swing.amplitudes(states)):
            break
    if best is None:
        raise OurBugError("Calming: no number of turns to try.")
    return best


def _direction(swing: Swing, mode: int, response: Float[np.ndarray, " modes"]) -> PerCable:
    """Of largest entry 1: moves this mode, and the others little where the pattern does not spare them already."""
    own = swing.gain[mode]
    selective = np.eye(len(own))
    for j, gain in enumerate(swing.gain):
        if j != mode:
            weight = SELECTIVE * (response[j] / response[mode]) ** 2 * (swing.lever[j] / swing.lever[mode]) ** 2
            selective += weight * np.outer(gain, gain) / (own @ own)
    found = np.linalg.solve(selective, own)
    return found / np.abs(found).max()


def _timed(
    swing: Swing,
    mode: int,
    states: np.ndarray,
    t: float,
    earliest: float,
    pattern: Pattern,
    response: np.ndarray,
    direction: np.ndarray,
    most: float,
) -> Calming:
    """The chain in the phase that takes the mode's swing away, as large as it is, at most `most` (m)."""
    s = swing.rates
    # y(end) = e^{s (begin + T − t)} y − size · gain·direction · response: begin so that both have the same phase
    pushed = complex((swing.gain[mode] @ direction) * response[mode])
    there = states[mode] * np.exp(s[mode] * (earliest + pattern.seconds - t))
    behind = float(np.angle(pushed / there))
    wait = (behind % np.pi) / abs(np.imag(s[mode]))  # a half turn is the other sign
    there = there * np.exp(s[mode] * wait)
    size = float((there / pushed).real)
    size = float(np.clip(size, -most, most))
    chain = Chain(pattern, size * direction)
    end = states * np.exp(s * (earliest + wait + pattern.seconds - t)) - swing.gain @ chain.direction * response
    return Calming(chain, earliest + wait, mode, swing.amplitudes(end))


def _whole(amplitudes: np.ndarray) -> float:
    return float(np.linalg.norm(amplitudes))
