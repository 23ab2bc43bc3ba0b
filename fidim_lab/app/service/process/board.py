"""Prompts on a board: any client answers, the first answer counts; a stated default answers where nobody does.

`PromptBoard` is the `Operator` of a service. In a rehearsal the simulated hand does what was asked once somebody says
that it is done, as a person at the robot would have.
"""

import asyncio
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from drivers.ports import Clock, Operator, Prompt, PromptKind
from fidim_lab.app.service.commands import Message
from fidim_lab.app.service.messages import PromptClosed, Question


@dataclass(frozen=True)
class DefaultAnswer:
    """What is answered where nobody does."""

    choice: str
    after: float = 0.0
    """s"""


class PromptBoard:
    """`Operator` whose prompts clients answer."""

    def __init__(
        self,
        clock: Clock,
        tell: Callable[[Message], None],
        defaults: Mapping[PromptKind, DefaultAnswer],
        hand: Operator | None,
    ) -> None:
        self.question: Question | None = None
        """the open one"""
        self.window = ""
        """that prompts belong to, as the engine has told"""
        self._clock = clock
        self._tell = tell
        self._defaults = defaults
        self._hand = hand
        self._number = 0
        self._answer: asyncio.Future[tuple[str, str]] | None = None

    async def answer(self, prompt: Prompt) -> str:
        """One of the prompt's choices, from a client or the default."""
        choice = await self._ask(prompt)
        if self._hand is not None and choice == prompt.choices[0]:
            await self._hand.answer(prompt)
        return choice

    def give(self, number: int, choice: str, by: str) -> str:
        """A client's answer; returns why it does not count, empty when it does."""
        question, waiting = self.question, self._answer
        if question is None or waiting is None or waiting.done() or question.number != number:
            return f"prompt {number} is not open any more"
        if choice not in question.choices:
            return f"“{choice}” is not an answer; the choices are {', '.join(question.choices)}"
        waiting.set_result((choice, by))
        return ""

    async def _ask(self, prompt: Prompt) -> str:
        self._number += 1
        default = self._defaults.get(prompt.kind)
        self._answer = waiting = asyncio.get_running_loop().create_future()
        self.question = question = Question(
            number=self._number,
            kind=prompt.kind.value,
            window=self.window,
            text=prompt.text,
            choices=prompt.choices,
            displacement=prompt.displacement,
            default=default.choice if default else "",
            default_after=default.after if default else None,
        )
        self._tell(question)
        timer = asyncio.ensure_future(self._default(waiting, default)) if default else None
        closed = PromptClosed(number=question.number)
        try:
            choice, by = await waiting
            closed = PromptClosed(number=question.number, choice=choice, by=by)
            return choice
        finally:
            if timer is not None:
                timer.cancel()
            self.question = self._answer = None
            self._tell(closed)

    async def _default(self, waiting: "asyncio.Future[tuple[str, str]]", default: DefaultAnswer) -> None:
        await self._clock.sleep(default.after)
        if not waiting.done():
            waiting.set_result((default.choice, "default"))
