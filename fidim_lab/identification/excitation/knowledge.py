"""What recordings taught about excitation by the winches, carried from try to try and window to window."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

MOST_DAMPING = 0.12
LIKELY = 0.03
"""damping where nothing has been recorded: 0.026–0.086 is seen in practice"""
SURE = 0.7
"""part of what was found that is taken for sure"""
GAINS = (0.5, 2.5)
"""tensions are looked at as though a gain below 1 were 1"""
RATIOS = (0.85, 1.15)


@dataclass(frozen=True, eq=False)
class Knowledge:
    """Per mode, slowest first."""

    damping: Float[np.ndarray, " modes"]
    """ζ"""
    ratio: Float[np.ndarray, " modes"]
    """true over modelled frequency"""
    gain: Float[np.ndarray, " modes"]
    """swing found over swing planned, with damping and frequency as they are"""
    least: Float[np.ndarray, " modes"]
    """the least damping there may be: with it tensions must keep their limits"""

    @staticmethod
    def none(modes: int) -> "Knowledge":
        """Nothing has been recorded yet."""
        return Knowledge(np.full(modes, LIKELY), np.ones(modes), np.ones(modes), np.zeros(modes))

    def fitting(self, modes: int) -> "Knowledge":
        """For a place with so many modes: what was known of as many."""
        return self if len(self.damping) == modes else Knowledge.none(modes)

    def by_identified_body(self) -> "Knowledge":
        """What of it holds where the body is identified, anywhere: how swings fade."""
        return replace(self, ratio=np.ones_like(self.ratio), gain=np.ones_like(self.gain))

    def elsewhere(self) -> "Knowledge":
        """What of it is believed at another equilibrium: no gain by which a swing could get larger than planned."""
        return Knowledge(self.damping, self.ratio, np.maximum(self.gain, 1.0), self.least)
