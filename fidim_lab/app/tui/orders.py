"""What keys ask of the service: each order with the lease it needs, and the questions before those that matter."""

from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Literal

from fidim_lab.app.service.commands import (
    Abort,
    AnswerPrompt,
    Command,
    Pause,
    Reset,
    Resume,
    Retry,
    Skip,
    Start,
    TakeLease,
)
from fidim_lab.app.service.latch import AT_START, first_words
from fidim_lab.app.service.messages import Answer, Welcome
from fidim_lab.app.tui.link import Link
from fidim_lab.app.tui.view import Connection, ScreenState
from fidim_lab.errors import FidimError, HardwareError

Verb = Literal["reset", "start", "pause", "skip", "retry", "abort", "lease"]

RESET = "reset: it may move then"
NOT_STOPPED = "✗✗ EMERGENCY STOP NOT CONFIRMED: PRESS THE HARDWARE STOP NOW."


@dataclass(frozen=True)
class Person:
    """Whoever is at the screen."""

    says: Callable[[str], None]
    """tell them"""
    confirms: Callable[[str, tuple[str, ...], str], Awaitable[bool]]
    """title, sentences, what yes does"""
    reasons: Callable[[str, str], Awaitable[str]]
    """title, proposal; empty: not to be done"""


class Orders:
    """Carries a person's orders to the service, and its answers back."""

    def __init__(self, link: Link, person: Person, reopen: Callable[[ScreenState], Awaitable[str]]) -> None:
        """reopen: start the service of an ended run again; returns what is to be said, raises FidimError."""
        self._link = link
        self._person = person
        self._reopen = reopen

    async def emergency_stop(self) -> None:
        """At once, without lease or question. Where nobody answers, that is said in capitals."""
        sent = self._link.stop()  # begun below, before anything is drawn
        self._person.says("EMERGENCY STOP sent …")
        try:
            answer = await sent
        except Exception as error:  # whatever it was: it is not confirmed
            self._person.says(f"{NOT_STOPPED} {error}")
            return
        self._person.says(f"EMERGENCY STOP: {answer.says}" if answer.ok else f"{NOT_STOPPED} {answer.says}")

    async def answer(self, prompt: int, choice: str) -> None:
        """Answer a prompt; the first answer of any client counts."""
        await self._send(AnswerPrompt(prompt=prompt, choice=choice), f"answered: {choice}")

    async def give(self, verb: Verb) -> None:
        """Carry an order out, with the questions it needs."""
        match verb:
            case "reset":
                await self._reset()
            case "start":
                await self._send(Start(), "the run begins")
            case "pause":
                await self._pause()
            case "skip":
                if reason := await self._person.reasons("Skip the present window. Why?", "by the operator"):
                    await self._send(Skip(reason=reason), "the window is skipped")
            case "retry":
                await self._send(Retry(reason="by the operator"), "the window will be recorded again")
            case "abort":
                await self._abort()
            case "lease":
                await self._lease(asked=True)

    async def _pause(self) -> None:
        status = self._link.view().status
        if status is not None and status.phase == "paused":
            await self._send(Resume(), "continuing, if the robot is where it was held")
        else:
            await self._send(Pause(reason="by the operator"), "pausing: the robot will be held")

    async def _abort(self) -> None:
        says = ("The run ends now, with the robot held. Recordings are kept; fidim resume continues the run later.",)
        if await self._person.confirms("Abort the run?", says, "abort"):
            await self._send(Abort(reason="by the operator"), "aborting: the robot is being held")

    async def _reset(self) -> None:
        """From a stop to a robot that may move: the service again where there is none, then the latch."""
        view = self._link.view()
        ended = view.status is not None and view.status.phase == "ended"
        if view.contact in (Connection.SEEKING, Connection.LOST, Connection.ENDED) or ended:
            await self._start_again(view)
        elif await self._lease() and await self._sure():
            why = "" if view.status is None else view.status.latched_why
            first = await self._try(Reset())
            if first is None or not first.code:
                return
            if why and first.says != first_words(why):
                self._person.says(f"✗ not reset: another stop came meanwhile. {first.says}")
                return
            await self._send(Reset(code=first.code), "the emergency stop is reset")

    async def _sure(self) -> bool:
        """Both questions; a service that has only just begun, and was never stopped, asks one."""
        status = self._link.view().status
        why = "" if status is None else status.latched_why
        says = (f"Latched: {why}." if why else "Latched.",)
        nobody = ("Is nobody near the platform and cables?",)
        if why == AT_START:
            return await self._person.confirms("Reset the emergency stop?", (*says, *nobody), RESET)
        asked = "Reset the emergency stop?"
        return await self._person.confirms(
            f"{asked} 1 of 2", (*says, "Has its cause been removed?"), "it was removed"
        ) and await self._person.confirms(f"{asked} 2 of 2", nobody, RESET)

    async def _start_again(self, view: ScreenState) -> None:
        says = (
            "The run of this screen has ended. Its service will be started again to continue the run.",
            "Nothing moves yet. Then r resets the emergency stop and g continues the run.",
        )
        if not await self._person.confirms("Continue this run?", says, "start its service"):
            return
        self._person.says("starting the service: it opens the rig …")
        try:
            said = await self._reopen(view)
        except FidimError as error:
            self._person.says(f"✗ not started: {error}")
            return
        self._person.says(f"{said}The service runs again. r resets the emergency stop, g continues the run.")

    async def _lease(self, *, asked: bool = False, then: str = "") -> bool:
        """Whether this client commands now; where another does, a person decides."""
        view = self._link.view()
        if view.offer is not None:
            await self._change_rig(view.offer)
            return False
        if view.commands:
            return True
        if view.commander:
            says = (f"{view.commander} commands the robot now; only one client can. It will still watch.",)
            if then:
                says = (*says, f"Then your order is carried out: {then}.")
            if not await self._person.confirms("Take command?", says, "take command"):
                return False
        answer = await self._try(TakeLease(force=bool(view.commander)))
        if asked and answer is not None:
            self._person.says("you command now")
        return answer is not None

    async def _change_rig(self, offer: Welcome) -> None:
        says = (
            f"This screen belongs to the rig “{self._link.rig}”, which has no service now.",
            f"The rig “{offer.rig}” has a service, with the run “{offer.run}” in {offer.folder}.",
            "After the change, orders and the emergency stop act on that rig.",
        )
        if await self._person.confirms(f"Change to the rig “{offer.rig}”?", says, "change"):
            self._link.change_rig()
            self._person.says(f"changing to the rig “{offer.rig}”")

    async def _send(self, command: Command, done: str) -> None:
        free = isinstance(command, AnswerPrompt)
        if (free or await self._lease(then=command.name)) and await self._try(command) is not None:
            self._person.says(done)

    async def _try(self, command: Command) -> Answer | None:
        try:
            answer = await self._link.command(command)
        except HardwareError as error:
            self._person.says(f"✗ {command.name} was not carried out: {error}")
            return None
        if not answer.ok:
            self._person.says(f"✗ {command.name}: {answer.says}")
            return None
        return answer
