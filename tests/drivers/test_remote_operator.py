"""Prompts over a socket: our operator against the hand's server, and against answers that are none."""

import asyncio
import json

import pytest

from drivers.ports import Prompt, PromptKind
from drivers.remote_operator import RemoteOperator
from fidim_lab.errors import DeviceError, InfeasibleError
from sim_backends.hand_server import HandServer

PROMPT = Prompt(PromptKind.DISPLACE_AND_RELEASE, "D", displacement=(0.01, -0.02))


class Hand:
    def __init__(self):
        self.asked = []

    async def answer(self, prompt):
        self.asked.append(prompt)
        if prompt.text == "impossible":
            raise InfeasibleError("The platform does not rest here.")
        return prompt.choices[-1]


def test_a_prompt_goes_there_and_its_answer_comes_back():
    async def main():
        hand = Hand()
        server = HandServer(hand, "127.0.0.1", 0)
        await server.start()
        operator = RemoteOperator("127.0.0.1", server.port)
        await operator.open()
        assert await operator.answer(PROMPT) == "abort"
        assert hand.asked == [PROMPT]
        with pytest.raises(DeviceError, match="does not rest here"):
            await operator.answer(Prompt(PromptKind.CONFIRM, "impossible"))
        assert await operator.answer(PROMPT) == "abort"
        await server.close()
        with pytest.raises(DeviceError, match="connection was lost"):
            await operator.answer(PROMPT)
        await operator.close()
        await operator.close()

    asyncio.run(main())


def test_nobody_there():
    async def main():
        with pytest.raises(DeviceError, match=r"cannot connect.*fidim simulators"):
            await RemoteOperator("127.0.0.1", 1).open()

    asyncio.run(main())


@pytest.mark.parametrize(
    ("reply", "says"),
    [
        (b"nonsense\n", "is not an answer"),
        (b"[]\n", "is not an answer"),
        (json.dumps({"id": 1, "answer": "perhaps"}).encode() + b"\n", "'perhaps' is not one of done, skip, abort"),
        (b"", "connection was lost while a prompt was open"),
    ],
)
def test_what_is_no_answer(reply, says):
    async def main():
        async def serve(reader, writer):
            await reader.readline()
            writer.write(json.dumps({"id": 0, "answer": "done"}).encode() + b"\n" + reply)
            writer.close()

        async with await asyncio.start_server(serve, "127.0.0.1", 0) as server:
            operator = RemoteOperator("127.0.0.1", server.sockets[0].getsockname()[1])
            await operator.open()
            with pytest.raises(DeviceError, match=says):
                await operator.answer(PROMPT)
            await operator.close()

    asyncio.run(main())
