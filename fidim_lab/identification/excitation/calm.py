"""Bringing the platform to rest by the winches: strokes that undo the swing that was seen.

The same strokes that excite a mode take its swing away when they come in the opposite phase. One chain at a time, on
the mode that swings most; then one looks again. What is left of a swing after a chain is some tenth of it. A stroke
begins while the platform swings: what tensions come of both is looked at by the nonlinear model before anything moves.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float

from fidim_lab.data.records import Body
from fidim_lab.errors import InfeasibleError, OurBugError
from fidim_lab.identification.excitation.candidates import DUTY, SPARE, direction_of
from fidim_lab.identification.excitation.motion import at_rest, line_of, wider
from fidim_lab.identification.excitation.place import MASS_OFF, Place, WinchLimits, inside
from fidim_lab.identification.excitation.strokes import COARSE, Chain, Pattern
from fidim_lab.model.driven import driven_motions
from fidim_lab.model.swing import Swing

TURNS = (1, 2, 3, 4, 6, 8, 12)
SHARES = (1.0, 0.6, 0.36, 0.2, 0.1, 0.05)
"""of what the winches may do, tried until tensions keep their limits"""
WORSE = 0.03
"""of what tensions may span: by so much may strokes pull beyond a swing that breaks limits by itself"""
AFTER = 1.0
"""s after the last stroke whose tensions are looked at"""
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
    place: Place,
    swing: Swing,
    states: Complex[np.ndarray, " modes"],
    t: float,
    earliest: float,
    limits: WinchLimits | None = None,
    bodies: Sequence[Body] = (),
) -> Calming:
    """The chain that takes most of the swing away, and leaves no tension limit on the way.

    swing: with damping and frequencies as seen. states: y at time t (s). earliest: s, when the first stroke may begin.
    bodies: others than the place's that may hang there. Raises InfeasibleError where even small strokes break a
    tension limit that the swing by itself keeps.
    """
    limits = limits or WinchLimits()
    low, high = inside(place.robot.limits.tension)
    pulls: tuple[float, float] | None = None
    for share in SHARES:
        found = _most(place, swing, states, t, earliest, limits, share)
        now = states * np.exp(swing.rates * (found.begin - t))
        if pulls is None:  # a swing that breaks a limit by itself may be calmed by strokes that make it hardly worse
            alone = _pulls(place, swing, now, found.chain.scaled(0.0), bodies)
            spare = WORSE * (high - low)
            low, high = min(low, alone[0] - spare), max(high, alone[1] + spare)
        pulls = _pulls(place, swing, now, found.chain, bodies)
        if low <= pulls[0] and pulls[1] <= high:
            return found
    pulled = "slack" if pulls is None or pulls[0] <= 0 else f"by {pulls[0]:.1f} to {pulls[1]:.1f} N"
    raise InfeasibleError(
        f"Strokes that calm the platform here would pull cables {pulled}; {low:.1f} to {high:.1f} N is allowed, "
        f"{100 * MASS_OFF:g} % kept for a mass that is off.",
        hint="Let it come to rest by itself, or choose an equilibrium farther from the tension limits.",
    )


def _pulls(place: Place, swing: Swing, states: np.ndarray, chain: Chain, bodies: Sequence[Body]) -> tuple[float, float]:
    """Smallest and largest tension (N) of a chain that begins with the modes in these states, of all bodies."""
    line = line_of((chain,), AFTER, COARSE)
    pose, twist = swing.motion(states)
    pull = line.accelerations(chain.direction[np.newaxis])[np.newaxis]
    found = at_rest(place, (chain,))
    for body in (place.body, *bodies):
        motion = driven_motions(place.mechanism, body, pose, pull, line.steps, swing.damping_matrix(), twist)
        found = wider(found, place.robot.mass * motion.tensions)
    return found


def _most(
    place: Place, swing: Swing, states: np.ndarray, t: float, earliest: float, limits: WinchLimits, share: float
) -> Calming:
    """The chain that takes most away with this share of what the winches may do; tensions are not looked at."""
    omega = np.abs(np.imag(swing.rates))
    mode = int(np.argmax(swing.amplitudes(states)))
    best: Calming | None = None
    for turns in TURNS:
        pattern = Pattern(np.pi / omega[mode], turns, DUTY)
        response = pattern.response(swing.rates) * swing.dragged
        direction = direction_of(swing, mode, np.abs(response))
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
