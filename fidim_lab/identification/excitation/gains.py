"""The gain of each cable on each mode, as chains of strokes show it.

CAD can have that wrong by half, or by three: a mode that winches hardly reach depends on where exactly the centre of
mass is. Each chain tells one number for each mode, the gain along its direction, so far as the swing without it is
foretold: by the frequencies before and after (large swings are slower), less well for large swings, which pass on
energy to each other.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from jaxtyping import Complex, Float

from fidim_lab.identification.excitation.strokes import Chain
from fidim_lab.model.swing import Swing

OFF = 1.0
"""part of a mode's gain by which CAD may have it wrong"""
DRIFT = 0.1
"""the same, by which it may differ from one chain to the next: gains of large swings are others"""
NOISE = 1e-4
"""m of the marker, to which a swing is seen"""
UNSURE = 0.05
"""part of a swing that is not foretold"""
SLIDING = 0.3
"""part of the change of frequency meanwhile that its mean does not cover"""
REACH = 0.3
"""m: a swing A disturbs the others by A² over this"""


@dataclass(frozen=True, eq=False)
class Look:
    """How the modes swing at a time."""

    states: Complex[np.ndarray, " modes"]
    """y"""
    t: float
    """s"""
    frequencies: Float[np.ndarray, " modes"]
    """Hz"""


@dataclass(frozen=True, eq=False)
class Gains:
    """The gain of each mode (`Swing.gain`), normally distributed."""

    mean: Float[np.ndarray, "modes n"]
    covariance: Float[np.ndarray, "modes n n"]

    @classmethod
    def by(cls, swing: Swing, off: float = OFF) -> Self:
        """As the model has it; off: the part of each mode's gain by which that may be wrong in any direction."""
        return cls(swing.gain, _variances(swing.gain, off))

    def after(self, chain: Chain, end: float, swing: Swing, before: Look, after: Look) -> "Gains":
        """With what a chain showed that ended at `end` (s), between two looks; `swing` has the damping."""
        omega = np.pi * (before.frequencies + after.frequencies)
        s = omega * (-swing.damping + 1j * np.sqrt(1 - swing.damping**2))
        passed = after.t - before.t
        free = before.states * np.exp(s * passed)
        by = -chain.pattern.response(s) * swing.dragged * np.exp(s * (after.t - end))
        sliding = SLIDING * 2 * np.pi * np.abs(after.frequencies - before.frequencies) * passed
        per_metre = np.abs(np.imag(s)) / swing.lever
        swings = np.linalg.norm(np.abs(free) / per_metre)
        unsure = np.hypot(UNSURE, sliding) * np.abs(free) + (NOISE + swings**2 / REACH) * per_metre
        d = chain.direction
        # the gain along d that explains what remains, and its variance
        seen = np.real(np.conj(by) * (after.states - free)) / np.abs(by) ** 2
        variance = (unsure / np.abs(by)) ** 2
        spread = self.covariance + _variances(self.mean, DRIFT)
        along = spread @ d
        weight = along / (along @ d + variance)[:, np.newaxis]
        mean = self.mean + weight * (seen - self.mean @ d)[:, np.newaxis]
        return Gains(mean, spread - weight[:, :, np.newaxis] * along[:, np.newaxis, :])


def _variances(gain: np.ndarray, part: float) -> Float[np.ndarray, "modes n n"]:
    size = part * np.linalg.norm(gain, axis=1)
    return size[:, np.newaxis, np.newaxis] ** 2 * np.eye(gain.shape[1])
