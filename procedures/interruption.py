"""What happens between a person's command and the next step: hold, wait, verify, continue. Nothing is repeated blindly.

Used by the engine alone. A pause ends with the interrupted step once more, or with `Retried` thrown into the
procedure where free motion was spoilt; skip and retry end with theirs, abort with `Aborted`.
"""

import asyncio
from collections.abc import Awaitable

from drivers.ports import DriveState
from procedures.control import Control, Retried, Skipped, Verb, Word
from procedures.events import Paused, Publisher, Resumed
from procedures.handlers.motion import hold
from procedures.recording.journal import Journal, LineKind
from procedures.stand import Stand
from procedures.steps import AfterPause, Hold, Lengths, Result, Step

MOVED = 2e-3
"""m by which a cable may have left the length at which it was paused: more is another place than the one verified"""


class Aborted(Exception):  # noqa: N818 - a person's word, not an error
    """The run ends here by a person's word."""


async def result_or_word(work: Awaitable[Result], control: Control) -> Result | Word:
    """The result of a step, or the word that came before it; the step is cancelled then, and has ended."""
    task = asyncio.ensure_future(work)
    heard = asyncio.ensure_future(control.heard())
    try:
        await asyncio.wait({task, heard}, return_when=asyncio.FIRST_COMPLETED)
        if task.done():
            return task.result()  # a word that came at the same moment waits for the next step
        task.cancel()
        await asyncio.wait({task})
        if not task.cancelled():  # it ended, well or badly, at that very moment
            return task.result()
        heard.result()
        return control.take() or Word(Verb.PAUSE, "the command was withdrawn")
    finally:
        heard.cancel()
        task.cancel()


class Interruption:
    """One interrupted step of one run."""

    def __init__(self, stand: Stand, control: Control, journal: Journal, publish: Publisher) -> None:
        self._stand = stand
        self._control = control
        self._journal = journal
        self._publish = publish

    async def carry_out(self, step: Step, word: Word) -> None:
        """Hold, then do as told; returns when the same step is to be carried out again.

        Raises Skipped, Retried or Aborted otherwise; DeviceError where a winch does not hold.
        """
        if word.verb is Verb.ABORT:
            raise Aborted(
                f"Aborted{f' by {word.by}' if word.by else ''} at “{step.text}”: {word.reason or 'no reason'}."
            )
        await self._hold()
        await self._stand.recorder.abandon()
        if word.verb is Verb.PAUSE:
            word = await self._paused(step, word)
        match word.verb:
            case Verb.SKIP:
                raise Skipped(word.reason or "skipped by the operator")
            case Verb.RETRY:
                raise Retried(word.reason or "repeated by the operator")
            case Verb.ABORT:
                raise Aborted(f"Aborted while paused at “{step.text}”: {word.reason or 'no reason'}.")
            case _:
                if step.after_pause is AfterPause.SAME_ATTEMPT:
                    raise Retried("the free motion was interrupted by a pause")

    async def _hold(self) -> None:
        """Hold where there is power to hold with."""
        samples = [winch.latest() for winch in self._stand.rig.winches]
        if all(sample is not None and sample.state is DriveState.OPERATION_ENABLED for sample in samples):
            await hold(self._stand, Hold())

    async def _paused(self, step: Step, word: Word) -> Word:
        """Wait until it may go on; returns the word that ended the pause."""
        places = self._places()
        self._tell(LineKind.PAUSED, Paused, step, word.sentence)
        while True:
            await self._control.heard()
            word = self._control.take() or word
            if word.verb is Verb.ABORT:
                return word
            wrong = self._verify(places)
            if not wrong:
                self._tell(LineKind.RESUMED, Resumed, step, word.sentence)
                return word
            self._tell(LineKind.PAUSED, Paused, step, f"still paused: {wrong}")

    def _places(self) -> Lengths | None:
        samples = [winch.latest() for winch in self._stand.rig.winches]
        return None if None in samples else tuple(s.length for s in samples if s is not None)

    def _verify(self, places: Lengths | None) -> str:
        """Why the run must not go on; empty when all winches report, are enabled, and stand where they were held."""
        if places is None:
            return ""
        now, allowed = self._stand.rig.clock.now(), self._stand.settings.guard.sample_age
        for winch, place in zip(self._stand.rig.winches, places, strict=True):
            sample = winch.latest()
            if sample is None or now - sample.t > allowed:
                return f"{winch.name} does not report"
            if sample.state is not DriveState.OPERATION_ENABLED:
                return f"{winch.name} is “{sample.state}”"
            if abs(moved := sample.length - place) > MOVED:
                return f"{winch.name} is {moved * 1e3:+.1f} mm from where it was held, {MOVED * 1e3:g} mm is allowed"
        return ""

    def _tell(self, kind: LineKind, event: type[Paused | Resumed], step: Step, says: str) -> None:
        places = self._places()
        data = {} if places is None else {"lengths": [round(length, 6) for length in places]}
        self._journal.write(kind, step=type(step).__name__, window=step.window, text=step.text, reason=says, data=data)
        self._publish(event(self._stand.rig.clock.now(), step.window, says))
