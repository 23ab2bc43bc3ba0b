"""Bringing the platform to rest by the winches: strokes that undo the swing that was seen.

The same strokes that excite a mode take its swing away when they come in the opposite phase. One chain at a time, on
the mode that swings most; then one looks again. What is left of a swing after a chain is some tenth of it.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float

from fidim_lab.errors import OurBugError
from fidim_lab.identification.excitation.candidates import DUTY, SPARE, direction_of
from fidim_lab.identification.excitation.place import Place, WinchLimits
from fidim_lab.identification.excitation.strokes import Chain, Pattern
from fidim_lab.model.swing import Swing

TURNS = (1, 2, 3, 4, 6, 8, 12)
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


def calmed(
    place: Place,
    swing: Swing,
    states: Complex[np.ndarray, " modes"],
    t: float,
    earliest: float,
    limits: WinchLimits | None = None,
) -> Calming:
    """The chain that takes most of the swing away.

    swing: with damping and frequencies as seen. states: y at time t (s). earliest: s, when the first stroke may begin.
    """
    limits = limits or WinchLimits()
    omega = np.abs(np.imag(swing.rates))
    mode = int(np.argmax(swing.amplitudes(states)))
    best: Calming | None = None
    for turns in TURNS:
        pattern = Pattern(np.pi / omega[mode], turns, DUTY)
        response = pattern.response(swing.rates) * swing.dragged
        direction = direction_of(swing, mode, np.abs(response))
        most = SPARE * min(
            limits.offset, limits.speed / pattern.speed, GENTLE * limits.acceleration / pattern.acceleration
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
