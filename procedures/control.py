"""Commands to a running run: pause, resume, skip, retry, abort; and the emergency stop.

`Control` is the one door into a running engine: a service, a console or a test says a `Word`; the engine takes it at
the running step, holds the robot, and tells the procedure by throwing an `Intervention` into its generator. A
procedure that catches `Skipped` and `Retried` around a window supports both; one that does not ends there, held.
"""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum


class Verb(StrEnum):
    """The commands."""

    PAUSE = "pause"
    """stop on the ramp and hold, until resumed"""
    RESUME = "resume"
    """verify that the robot is where it was held, then go on"""
    SKIP = "skip"
    """go on without this window"""
    RETRY = "retry"
    """this window, or its recording, once more"""
    ABORT = "abort"
    """end the run here, held"""


@dataclass(frozen=True)
class Word:
    """One thing said, by whom and why."""

    verb: Verb
    reason: str = ""
    by: str = ""

    @property
    def sentence(self) -> str:
        """For journal and listeners."""
        by = f" by {self.by}" if self.by else ""
        return f"{self.verb}{by}{f': {self.reason}' if self.reason else ''}"


class Intervention(Exception):  # noqa: N818 - not an error: a person's word, thrown into a procedure
    """A person changed what comes next."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


class Skipped(Intervention):
    """Go on without this window."""


class Retried(Intervention):
    """Do this window, or its recording, once more."""


Judge = Callable[[Word], str]
"""why a word cannot be taken now; empty when it can"""


def nothing_runs(_word: Word) -> str:
    """The answer of a control without an engine to every command."""
    return "nothing is running"


class Control:
    """One request of an operator at a time, on its way to the engine. For the engine's own event loop only."""

    def __init__(self, latched: Callable[[], str] = str) -> None:
        """latched: why no run may go on, empty where it may; asked when a run begins."""
        self._latched = latched
        self._word: Word | None = None
        self._said = asyncio.Event()
        self._judge: Judge = nothing_runs
        self._stop: Callable[[str], None] | None = None

    def attach(self, judge: Judge, stop: Callable[[str], None]) -> None:
        """The engine's side: who judges words, and what stops all winches at once.

        It does so before this returns where a stop was given while nothing ran yet: after "start", before the engine.
        """
        self.take()  # what was said to an earlier run is not meant for this one
        self._judge, self._stop = judge, stop
        if why := self._latched():
            stop(why)

    def detach(self) -> None:
        """The engine has ended: nothing can be told any more."""
        self._judge, self._stop = nothing_runs, None

    def say(self, word: Word) -> str:
        """Hand a request over; returns why it is refused, empty when the engine will act on it."""
        if word.verb is not Verb.ABORT and self._word is not None:
            return f"“{self._word.verb}” is being carried out"
        refusal = self._judge(word)
        if not refusal:
            self._word = word
            self._said.set()
        return refusal

    def emergency_stop(self, reason: str) -> bool:
        """Stop all winches before this returns, and end the run; False when nothing is running."""
        if self._stop is None:
            return False
        self._stop(reason)
        return True

    async def heard(self) -> None:
        """Wait until there is a word; it stays until it is taken."""
        await self._said.wait()

    def take(self) -> Word | None:
        """The word, which is then gone."""
        word, self._word = self._word, None
        self._said.clear()
        return word
