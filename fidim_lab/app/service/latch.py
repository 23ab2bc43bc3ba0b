"""The software emergency stop's latch: latched from the start, and reset only deliberately, in two steps."""

import secrets
from collections.abc import Callable

CODE_LIFE = 30.0
"""s for which a code of the first step counts"""
AT_START = "the service has only just begun; look at the robot, then reset"


class Latch:
    """Latched or not, and why. A reset asks for a code first, which the second step repeats."""

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        self._code = ""
        self._until = 0.0
        self.why = AT_START

    @property
    def latched(self) -> bool:
        """Whether no motion may begin."""
        return bool(self.why)

    def latch(self, why: str) -> None:
        """Latch; a code given out before counts no more."""
        self.why, self._code = why or "emergency stop", ""

    def first_step(self) -> str:
        """A code for the second step."""
        self._code, self._until = f"{secrets.randbelow(10_000):04d}", self._now() + CODE_LIFE
        return self._code

    def second_step(self, code: str) -> bool:
        """Whether the code is that of the first step, and the latch open now."""
        good = bool(self._code) and self._now() <= self._until and secrets.compare_digest(code, self._code)
        self._code = ""
        if good:
            self.why = ""
        return good
