"""Encoder counts and cable lengths, both ways, through the 32-bit wrap. Pure."""

import math
from dataclasses import dataclass

COUNT_MIN, COUNT_MAX = -(2**31), 2**31 - 1
_TURN = 2**32


def wrap32(count: int) -> int:
    """The signed 32-bit number that a drive would show for `count`."""
    return (count - COUNT_MIN) % _TURN + COUNT_MIN


@dataclass(frozen=True)
class LengthScale:
    """Cable length l = home_length + direction · (count − home_count) / counts_per_metre.

    The difference is taken modulo 2³², so that lengths stay continuous where the encoder wraps, within ± 2³¹
    counts of home.
    """

    counts_per_metre: float
    """at the drum, gear included, > 0"""
    direction: int
    """+1 where rising counts pay cable out, −1 otherwise"""
    home_count: int = 0
    home_length: float = 0.0
    """m, cable length at `home_count`"""

    @staticmethod
    def of_drum(counts_per_turn: float, drum_radius: float, direction: int, count: int, length: float) -> "LengthScale":
        """The scale of a drum of `drum_radius` (m) that turns once in `counts_per_turn` counts."""
        return LengthScale(counts_per_turn / (2.0 * math.pi * drum_radius), direction, count, length)

    def length(self, count: int) -> float:
        """Cable length (m) at an encoder count."""
        return self.home_length + self.direction * wrap32(count - self.home_count) / self.counts_per_metre

    def unwrapped_count(self, length: float) -> int:
        """Encoder count of a cable length (m), not yet wrapped to 32 bits."""
        return self.home_count + self.direction * round((length - self.home_length) * self.counts_per_metre)

    def count(self, length: float) -> int:
        """Encoder count of a cable length (m), as a drive shows it."""
        return wrap32(self.unwrapped_count(length))

    def velocity(self, counts_per_second: float) -> float:
        """Cable velocity, m/s, positive pays out."""
        return self.direction * counts_per_second / self.counts_per_metre

    def magnitude(self, metres: float) -> int:
        """A length, speed or acceleration without direction in counts (/s, /s²), at least 1."""
        return max(1, round(abs(metres) * self.counts_per_metre))
