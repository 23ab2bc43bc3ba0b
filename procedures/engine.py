"""The engine: carries out a procedure's steps by their handlers while the guards are checked.

Plain asyncio. One task performs steps, another watches; the first that ends decides. Whatever ends a run, `run.py`
holds the robot afterwards. Nothing is retried or replayed here: what happens next is the procedure's word.
"""

import asyncio
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from drivers.ports import Prompt, Rig
from fidim_lab.errors import GuardError, OurBugError
from procedures.control import Control, Intervention, Verb, Word
from procedures.events import Prompted, Publisher, StepFinished, StepProgress, StepStarted, Tripped, Warned
from procedures.guards.guard import Guard, Observation, Reaction, Trip, watch
from procedures.handlers import Handler
from procedures.interruption import Aborted, Interruption, result_or_word
from procedures.outcomes import Outcome
from procedures.pace import Pace
from procedures.protocols.listing import Outline
from procedures.pulse import Pulse
from procedures.recording.disk import settled
from procedures.recording.journal import Journal, LineKind
from procedures.recording.journal_data import step_data
from procedures.recording.ledger import Ledger
from procedures.settings import GuardSettings
from procedures.stand import MarkerNews, Stand
from procedures.steps import AfterPause, CheckWindow, Enable, Procedure, Record, Result, Step, Stop
from procedures.stopping import quick_stop

PROGRESS_PERIOD = 0.1
"""s between two progress events"""
END_TIMEOUT = 1.0
"""s that a cancelled step is waited for"""


@dataclass(frozen=True)
class ProcedureEnd:
    """How a procedure itself ended; devices and guards end it with an error instead."""

    outcome: Outcome
    reason: str = ""
    wrong_input: bool = False
    """by a mistake in a file of the user's"""


class Engine:
    """Runs one procedure, once. Raises GuardError when a guard trips, and whatever a handler raises."""

    def __init__(
        self,
        rig: Rig,
        outline: Outline,
        journal: Journal,
        publish: Publisher,
        ledger: Ledger,
        control: Control,
    ) -> None:
        self.pulse = Pulse()
        self.news = MarkerNews()
        self._tasks: tuple[asyncio.Future[Any], ...] = ()
        self._control = control
        self._pace = Pace()
        self._stopped = asyncio.Event()
        self._rig = rig
        self._outline = outline
        self._journal = journal
        self._publish = publish
        self._ledger = ledger

    async def run(
        self,
        procedure: Procedure,
        stand: Stand,
        handlers: Mapping[type[Step], Handler],
        guards: Sequence[Guard],
        settings: GuardSettings,
    ) -> ProcedureEnd:
        """Perform all steps while the guards are checked; none where an emergency stop came before."""
        self._control.attach(self._judge, self.emergency_stop)
        if self.pulse.trip is not None:
            self._control.detach()
            raise self._tripped(self.pulse.trip)
        work = asyncio.ensure_future(self._perform_all(procedure, stand, handlers))
        guarding = asyncio.ensure_future(watch(self._rig.clock, guards, self._look, settings, self._react))
        stopping = asyncio.ensure_future(self._stopped.wait())
        self._tasks = work, guarding, stopping
        try:
            await asyncio.wait({work, guarding, stopping}, return_when=asyncio.FIRST_COMPLETED)
            if self.pulse.trip is None:
                if guarding.done():
                    guarding.result()  # only a trip or a bug ends the watch before it is cancelled: a bug raises here
                return work.result()
        finally:
            self._control.detach()
            await self._cancel_all(hurry=not work.done())
        raise self._tripped(self.pulse.trip)

    def _tripped(self, trip: Trip) -> GuardError:
        where = f" It was at “{self.pulse.step.text}”." if self.pulse.step else ""  # last: one line may show no more
        says = trip.says if trip.says.endswith((".", "?")) else f"{trip.says}."
        return GuardError(f"The {trip.guard} guard stopped the run: {says}{where}")

    async def _cancel_all(self, *, hurry: bool) -> None:
        for task in self._tasks:
            task.cancel()
        if not hurry and self.pulse.trip is None:
            await self.ended()

    async def ended(self) -> None:
        """Wait, for a limited time, for tasks that `run` left; only once the robot is held."""
        done, _ = await asyncio.wait(self._tasks, timeout=END_TIMEOUT) if self._tasks else (set(), None)
        for task in done:
            if not task.cancelled():
                task.exception()  # seen: what counts has been raised already

    def emergency_stop(self, reason: str) -> None:
        """Quick-stop all winches before this returns, and end the run."""
        first = self.pulse.trip
        if first is not None:  # what tripped first stays the reason; a hold becomes a quick stop
            self.pulse.trip = replace(first, reaction=Reaction.QUICK_STOP)
        self._react(Trip(self._rig.clock.now(), "emergency stop", reason, Reaction.QUICK_STOP))
        self._stopped.set()

    def _judge(self, word: Word) -> str:
        """Why a word cannot be taken now; empty when it can."""
        step = self.pulse.step
        if step is None or self.pulse.trip is not None:
            return "the run is beginning" if step is None else "the run is being stopped"
        if self.pulse.paused:
            return "the run is paused already" if word.verb is Verb.PAUSE else ""
        if word.verb is Verb.RESUME:
            return "the run is not paused"
        if word.verb in (Verb.SKIP, Verb.RETRY):
            if not step.window:
                return f"“{step.text}” does not belong to a window"
            if step.after_pause is AfterPause.NOT_INTERRUPTED:
                return f"“{step.text}” is just ending; repeat the command in a moment"
        return ""

    async def _perform_all(
        self, procedure: Procedure, stand: Stand, handlers: Mapping[type[Step], Handler]
    ) -> ProcedureEnd:
        steps = procedure()
        try:
            step = next(steps)
            while not isinstance(step, Stop):
                got = await self._perform(step, stand, handlers)
                step = steps.throw(got) if isinstance(got, Intervention) else steps.send(got)
        except StopIteration:
            return ProcedureEnd(self._ledger.outcome, self._ledger.reason)
        except Aborted as end:
            return ProcedureEnd(Outcome.ABORTED, str(end))
        except Intervention as word:
            return ProcedureEnd(
                Outcome.ABORTED, f"This procedure cannot skip or repeat, so it ends here: {word.reason}."
            )
        finally:
            steps.close()
        self._begin(step)
        self._end(step, Result(step.outcome, step.reason))
        return ProcedureEnd(step.outcome, step.reason)

    async def _perform(self, step: Step, stand: Stand, handlers: Mapping[type[Step], Handler]) -> Result | Intervention:
        """What came of the step, or the word that is to be thrown into the procedure instead."""
        handler = handlers.get(type(step))
        if handler is None:
            raise OurBugError(f"No handler for the step {type(step).__name__} ({step.text}).")
        interruption = Interruption(stand, self._control, self._journal, self._publish)
        while True:
            self._begin(step)
            if step.details or isinstance(step, Enable):  # what the disk does not have must not move
                await settled(stand.disk)
            if step.after_pause is AfterPause.NOT_INTERRUPTED:
                result: Result | Word = await handler(stand, step)
            else:
                result = await result_or_word(handler(stand, step), self._control)
            if isinstance(result, Result):
                result = self._spoiled(step, result)
                self._pace.learn(step, self._rig.clock.now() - self.pulse.begun)
                self._end(step, result)
                return result
            self._end(step, Result(Outcome.SKIPPED, f"interrupted: {result.sentence}"))
            self.pulse.paused = True
            try:
                await interruption.carry_out(step, result)
            except Intervention as word:
                return word

    def _spoiled(self, step: Step, result: Result) -> Result:
        """A window that a guard has spoiled is rejected, whatever its check found."""
        if not isinstance(step, CheckWindow) or (says := self.pulse.spoiled.pop(step.window, "")) == "":
            return result
        return replace(result, outcome=Outcome.FAIL, reason="; ".join(filter(None, (says, result.reason))))

    def _begin(self, step: Step) -> None:
        pulse = self.pulse
        planned = self._outline.left_from(step)
        left = pulse.left if planned is None else self._pace.total(planned)
        pulse.step, pulse.number, pulse.left, pulse.told = step, pulse.number + 1, left, -1.0
        pulse.begun, pulse.paused = self._rig.clock.now(), False
        pulse.touched |= isinstance(step, Enable) or step.phase.powered
        details = step.details  # of a motion: must be on the disk before it begins
        name, synced = type(step).__name__, bool(details)
        self._journal.write(
            LineKind.STEP_STARTED, sync=synced, step=name, window=step.window, text=step.text, data=dict(details)
        )
        self._publish(StepStarted(self._rig.clock.now(), pulse.number, step, left))

    def _end(self, step: Step, result: Result) -> None:
        self._journal.write(
            LineKind.STEP_FINISHED,
            step=type(step).__name__,
            window=step.window,
            outcome=result.outcome,
            reason=result.reason,
            data=step_data(result.measurements, result.values, result.answer, result.readings),
        )
        now = self._rig.clock.now()
        self._publish(
            StepFinished(now, self.pulse.number, step, result, max(self.pulse.left - self._pace.seconds(step), 0.0))
        )
        finished = self._ledger.take(step, result, now)
        if finished is not None:
            self._publish(finished)

    def progress(self, fraction: float) -> None:
        """Report the progress of a step; listeners are told at most ten times a second."""
        pulse, now = self.pulse, self._rig.clock.now()
        if pulse.step is None or now - pulse.told < PROGRESS_PERIOD:
            return
        pulse.told = now
        part = min(max(fraction, 0.0), 1.0)
        left = max(pulse.left - part * self._pace.seconds(pulse.step), 0.0)
        self._publish(StepProgress(now, pulse.number, pulse.step, part, left))

    def prompted(self, window: str, prompt: Prompt) -> None:
        """A handler is about to ask."""
        self._publish(Prompted(self._rig.clock.now(), window, prompt))

    def _look(self) -> Observation:
        now, frame = self._rig.clock.now(), self._rig.markers.latest()
        self.news.take(frame, now)
        return Observation(
            t=now,
            phase=self.pulse.phase,
            winches=tuple(winch.latest() for winch in self._rig.winches),
            frame=frame,
            commanded=tuple(winch.commanded for winch in self._rig.winches),
        )

    def _react(self, trip: Trip) -> None:
        """In the cycle of the trip: latch, and stop all winches where the guard asks for it (else they are held)."""
        if trip.reaction is Reaction.REJECT_WINDOW:
            step = self.pulse.step
            if not isinstance(step, Record) or step.window in self.pulse.spoiled:
                return
            self.pulse.spoiled[step.window] = f"the {trip.guard} guard: {trip.says}"
        if trip.reaction in (Reaction.WARN, Reaction.REJECT_WINDOW):
            self._journal.write(LineKind.WARNED, sync=False, text=trip.guard, reason=trip.says)
            self._publish(Warned(trip.t, trip))
            return
        if trip.reaction is Reaction.QUICK_STOP:
            for winch in self._rig.winches:
                quick_stop(winch)
        if self.pulse.trip is not None:
            return  # latched: the first one says why
        self.pulse.trip = trip
        self._publish(Tripped(trip.t, trip))
