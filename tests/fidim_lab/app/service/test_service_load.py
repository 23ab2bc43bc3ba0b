"""Many clients at once, floods of commands, silent connections: the loop goes on, an owner can always stop."""

import asyncio
import gc
import itertools
import json
import time

import pytest

from drivers.clock import LoopClock
from fidim_lab.app.service.client import connect
from fidim_lab.app.service.codec import encode
from fidim_lab.app.service.commands import EmergencyStop, Hello, Request, TakeLease
from fidim_lab.app.service.messages import Answer, Happening, Welcome
from fidim_lab.app.service.process import hub
from fidim_lab.app.service.process.event_log import EventLog
from fidim_lab.app.service.process.hub import BURST, CLIENTS_TCP, COMMANDS, Hub

EVENTS, CLIENTS = 1500, 25


class Peer:
    """A hub that answers everything with yes, and a long history."""

    def __init__(self, path):
        self.path = path
        self.asked = []
        self.hub = Hub(self.answer, self.greet, lambda _: None)
        self.event_log = EventLog(lambda: 1.0, lambda: "2026-01-01T00:00:00Z", self.hub.tell)
        for number in range(EVENTS):
            self.event_log.note(kind="lease", text=f"client {number} commands now", reason="x" * 150)

    def answer(self, client, request):
        self.asked.append((client.hello.client, type(request.command)))
        self.event_log.note(kind="lease", text=client.name)
        return Answer(id=request.id, ok=True)

    def greet(self, client):
        names = {"run": "r", "folder": "f", "rig": "g", "windows": (), "winches": ()}
        return itertools.chain([encode(Welcome(you=client.number, **names))], self.event_log.history())


@pytest.fixture
def peer(socket_path):
    return Peer(socket_path)


async def turns(worst):
    """The longest CPU time of this process between two turns of a task, s: what one callback took."""
    while True:
        before = time.thread_time()
        await asyncio.sleep(0)  # noqa: TID251 - turns of the loop are counted
        worst[0] = max(worst[0], time.thread_time() - before)


def test_many_clients_that_attach_at_once_get_a_long_history_in_pieces(peer):
    worst = [0.0]

    async def attach(number):
        async with connect(peer.path, name=f"late{number}") as client:
            while client.history is None or client.history.more:
                await anext(client)
            return client.history

    async def main():
        await peer.hub.listen_unix(peer.path)
        writers = []
        for number in range(CLIENTS):
            _, writer = await asyncio.open_unix_connection(peer.path)
            writer.write(encode(Hello(client=f"c{number}")))
            writers.append(writer)
        gc.disable()  # the test's own heap is large: looking through it takes longer than what is measured
        watching = asyncio.ensure_future(turns(worst))
        while peer.hub.clients < CLIENTS:
            await LoopClock().sleep(0.01)
        await LoopClock().sleep(0.3)
        watching.cancel()
        gc.enable()
        history = await attach(0)
        assert [event.number for event in history.events] == list(range(1, EVENTS + 1))
        for writer in writers:
            writer.close()
        peer.hub.close()

    asyncio.run(main())
    assert worst[0] < 0.02  # s; all of it at once, as objects, took half a second


def test_a_flood_of_commands_is_taken_at_its_rate_and_a_stop_is_not_kept_waiting(peer):
    async def main():
        await peer.hub.listen_unix(peer.path)
        async with connect(peer.path, name="owner") as owner:
            _, flooder = await asyncio.open_unix_connection(peer.path)
            flooder.write(encode(Hello(client="flooder")))
            flooder.write(encode(Request(id=1, command=TakeLease(force=True))) * 3000)
            await LoopClock().sleep(0.5)
            begun = time.monotonic()
            assert (await owner.command(EmergencyStop())).ok
            took = time.monotonic() - begun
            flooder.close()
            peer.hub.close()
            return took

    begun = time.monotonic()
    took = asyncio.run(main())
    passed = time.monotonic() - begun
    count = sum(name == "flooder" for name, _ in peer.asked)
    assert BURST <= count <= BURST + COMMANDS * passed + 1
    assert took < 5.0  # s; the flood alone would take minutes at its rate


@pytest.mark.parametrize("greeted", [False, True])
def test_a_stop_counts_though_its_client_is_killed_right_after_it(peer, greeted, monkeypatch):
    """Others attach at that moment: its turn comes when it has gone. What else it had asked for is not done."""
    monkeypatch.setattr(hub, "TURN", 0.0)  # a slow computer: one thing at a time

    async def main():
        await peer.hub.listen_unix(peer.path)
        reader, stopper = await asyncio.open_unix_connection(peer.path)
        stopper.write(encode(Hello(client="stopper")))
        if greeted:
            await reader.readline()
        others = [await asyncio.open_unix_connection(peer.path) for _ in range(CLIENTS - 1)]
        for _, writer in others:
            writer.write(encode(Hello(client="late")))
        stopper.write(encode(Request(id=1, command=EmergencyStop())) + encode(Request(id=2, command=TakeLease())))
        stopper.transport.abort()
        await LoopClock().sleep(0.5)
        for _, writer in others:
            writer.close()
        peer.hub.close()

    asyncio.run(main())
    assert [command for name, command in peer.asked if name == "stopper"] == [EmergencyStop]


def test_a_client_that_waits_is_served_when_its_time_comes(peer):
    count = int(BURST) + 10

    async def main():
        await peer.hub.listen_unix(peer.path)
        async with connect(peer.path, name="script") as client:
            for _ in range(count):
                assert (await client.command(TakeLease())).ok
        peer.hub.close()

    asyncio.run(main())
    assert len(peer.asked) == count


def test_what_happens_while_history_is_sent_comes_after_it_once(peer):
    async def main():
        await peer.hub.listen_unix(peer.path)
        reader, writer = await asyncio.open_unix_connection(peer.path, limit=1 << 20)
        writer.write(encode(Hello(client="c")))
        while not peer.hub.clients:
            await LoopClock().sleep(0.0)
        peer.event_log.note(kind="lease", text="meanwhile")
        numbers = []
        while not numbers or numbers[-1] <= EVENTS:
            said = json.loads(await reader.readline())
            if said["type"] == "history":
                numbers += [event["number"] for event in said["events"]]
            elif said["type"] == "event":
                numbers.append(Happening.model_validate(said).number)
        writer.close()
        peer.hub.close()
        assert numbers == list(range(1, EVENTS + 2))

    asyncio.run(main())


def test_places_on_tcp_are_apart_and_the_silent_give_theirs_up(peer):
    async def main():
        await peer.hub.listen_unix(peer.path)
        port = await peer.hub.listen_tcp(0, "secret")
        silent = [await asyncio.open_connection("127.0.0.1", port) for _ in range(3 * CLIENTS_TCP)]
        async with connect(peer.path, name="owner") as owner, connect(port=port, token="secret", name="far") as far:
            assert (await owner.command(EmergencyStop())).ok
            assert (await far.command(EmergencyStop())).ok
        for _, writer in silent:
            writer.close()
        peer.hub.close()

    asyncio.run(main())
