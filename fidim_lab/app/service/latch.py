"""The software emergency stop's latch: latched from the start, and reset only deliberately, in two steps."""

import secrets
from collections.abc import Callable
from typing import Protocol

from fidim_lab.data.rigs.stop_file import Stopped

CODE_LIFE = 30.0
"""s for which a code of the first step counts"""
AT_START = "the service has just started; look at the robot, then reset"


class Keeper(Protocol):
    """Where a stop is kept beyond the service."""

    def kept(self) -> Stopped | None:
        """The stop that is kept."""
        ...

    def keep(self, stopped: Stopped) -> None:
        """Keep it; returns at once and raises nothing."""
        ...

    def forget(self) -> str:
        """Keep none any more; returns why not, empty where it is done."""
        ...


class Unkept:
    """Keeps nothing: a stop ends with the service."""

    def kept(self) -> Stopped | None:
        """None."""
        return None

    def keep(self, stopped: Stopped) -> None:
        """Nothing."""

    def forget(self) -> str:
        """It is forgotten already."""
        return ""


class Latch:
    """Latched or not, and why. A reset asks for a code first, which the second step repeats."""

    def __init__(self, now: Callable[[], float], keeper: Keeper | None = None) -> None:
        self._now = now
        self._keeper = keeper or Unkept()
        self._code = ""
        self._until = 0.0
        before = self._keeper.kept()
        self.why = AT_START if before is None else before.sentence

    @property
    def latched(self) -> bool:
        """Whether no motion may begin."""
        return bool(self.why)

    def latch(self, stopped: Stopped) -> None:
        """Latch; the first cause stays the reason, and reset codes issued before become invalid."""
        self._code = ""
        if self.why in ("", AT_START):
            self.why = stopped.sentence
            self._keeper.keep(stopped)

    def first_step(self) -> str:
        """A code for the second step."""
        self._code, self._until = f"{secrets.randbelow(10_000):04d}", self._now() + CODE_LIFE
        return self._code

    def second_step(self, code: str) -> str:
        """Open it where the code is that of the first step; returns why not, empty where it is open now."""
        good = bool(self._code) and self._now() <= self._until and secrets.compare_digest(code, self._code)
        self._code = ""
        if not good:
            return "The code is wrong or has expired; request a new one."
        if not (why := self._keeper.forget()):
            self.why = ""
        return why


def first_words(why: str) -> str:
    """The answer to the first step of a reset: which stop a client would undo."""
    return f"Latched: {why}. Send the code to reset."
