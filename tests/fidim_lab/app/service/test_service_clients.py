"""What clients see and may do, and what they cannot do to a run."""

import asyncio
import itertools
import json
import socket
import stat

import pytest

from drivers.ports import DriveState, PromptKind
from fidim_lab.app.service.client import ServiceGoneError, connect
from fidim_lab.app.service.codec import encode
from fidim_lab.app.service.commands import (
    Abort,
    EmergencyStop,
    Hello,
    Pause,
    Reset,
    Resume,
    Shutdown,
    Skip,
    Start,
    TakeLease,
)
from fidim_lab.app.service.messages import (
    Happening,
    PromptClosed,
    Question,
    Samples,
    Status,
)
from fidim_lab.app.service.process.board import DefaultAnswer
from fidim_lab.data.campaign import read_campaign
from fidim_lab.errors import RefusedError, SetupError
from sim_backends.drive.axis.machine import State


def test_a_run_told_to_a_client_from_start_to_end(serving):
    seen = []
    serving.plan = serving.two

    async def script(s):
        async with s.client() as client:
            await s.begin(client)
            async for message in client:
                seen.append(message)
            assert client.bye.exit_code == 0

    assert serving.run(script) == 0
    assert [w.id for w in read_campaign(serving.folder).windows] == ["i01", "i02"]
    events = [m for m in seen if isinstance(m, Happening)]
    assert [e.number for e in events] == list(range(1, len(events) + 1))
    assert [(e.window, e.outcome) for e in events if e.kind == "window-finished"] == [("i01", "pass"), ("i02", "pass")]
    states = [m for m in seen if isinstance(m, Status)]
    gaps = [b.t - a.t for a, b in itertools.pairwise(states)]
    assert sorted(gaps)[len(gaps) // 2] == pytest.approx(0.1, abs=0.01)
    rich = next(m for m in states if m.step and m.step.step == "Record")
    assert {w.drive for w in rich.winches} == {"operation enabled"}
    assert all(20 < w.tension < 200 and w.age < 0.1 and w.length > 1 for w in rich.winches)
    assert rich.mocap.measured_rate == pytest.approx(100.0, rel=0.1)
    assert rich.bus.frames > 500
    assert 0.0 < rich.bus.load < 1.0
    assert {g.state for g in rich.guards} == {"armed"}
    assert rich.equilibria[0].margin > 0
    table = states[-1].equilibria
    assert [(row.state, row.verdict, row.attempts) for row in table] == [("done", "pass", 1)] * 2
    assert all(row.amplitude > 0.005 for row in table)
    recorded = [m for m in seen if isinstance(m, Samples) and m.window == "i01"]
    assert sum(len(m.t) for m in recorded) == pytest.approx(150, abs=25)
    assert len(seen) == len(set(map(id, seen)))


def test_a_client_that_comes_late_gets_history_state_and_the_open_question(serving):
    serving.answers = {PromptKind.STEADY: DefaultAnswer("done")}
    serving.plan = serving.two

    async def script(s):
        async with s.client("first", samples=False) as first:
            await s.begin(first)
            question = await s.until(first, lambda m: isinstance(m, Question) and m.kind == "displace-and-release")
            async with s.client("late") as late:
                again = await s.until(late, lambda m: isinstance(m, Question))
                assert again == question
                assert late.history.events[0].number == 1
                assert [e.kind for e in late.history.events if e.kind == "run-started"] == ["run-started"]
                assert late.status.prompt == question.number
                wrong = await late.answer(question.number, "perhaps")
                assert not wrong.ok
                assert (await late.answer(question.number, "done")).ok, "no lease is needed"
                closed = await s.until(first, lambda m: isinstance(m, PromptClosed))
                assert (closed.choice, closed.by) == ("done", late_name(late))
                assert not (await first.answer(question.number, "done")).ok, "the first answer counts"
            question = await s.until(first, lambda m: isinstance(m, Question) and m.kind == "displace-and-release")
            assert (await first.answer(question.number, "skip")).ok

    assert serving.run(script) == 1
    assert [w.id for w in read_campaign(serving.folder).windows] == ["i01"]


def late_name(client):
    return f"late #{client.welcome.you}"


def test_one_client_commands_the_others_watch(serving):
    async def script(s):
        async with s.client("one") as one, s.client("two") as two:
            await one.take_lease()
            for command in (Start(), Pause(), Skip(reason="x"), Abort(reason="x"), Reset(), Shutdown()):
                refused = await two.command(command)
                assert not refused.ok
                assert "has the lease" in refused.says
            with pytest.raises(RefusedError, match="has the lease"):
                await two.take_lease()
            assert (await two.command(TakeLease(force=True))).ok
            assert not (await one.command(Start())).ok
            assert "latched" in (await two.command(Start())).says
            await two.reset()
            assert (await two.command(Shutdown())).ok

    assert serving.run(script) == 1
    assert not serving.folder.exists()


def test_the_lease_of_a_client_that_has_gone_is_free_and_its_run_is_paused_and_resumed_by_another(serving):
    async def script(s):
        async with s.client("one") as one:
            await s.begin(one)
        async with s.client("two") as two:
            await s.until(two, lambda m: isinstance(m, Status) and m.commanding is None)
            await two.take_lease()
            await s.until(two, lambda m: isinstance(m, Status) and m.step is not None and m.step.step == "Settle")
            await two.require(Pause(reason="tea"))
            await s.until(two, lambda m: isinstance(m, Status) and m.phase == "paused")
            assert not (await two.command(Pause())).ok
            await s.rig.rig.clock.sleep(3.0)
            await two.require(Resume())
            async for _ in two:
                pass

    assert serving.run(script) == 0


def test_anybodys_emergency_stop_stops_at_once_and_stays_latched(serving):
    serving.stay = True

    async def script(s):
        async with s.client("one") as one, s.client("visitor") as visitor:
            await s.begin(one)
            await s.until(visitor, lambda m: isinstance(m, Status) and m.step is not None and m.step.step == "Settle")
            before = s.rig.rig.clock.now()
            assert (await visitor.command(EmergencyStop(reason="smoke"))).ok
            assert s.rig.rig.clock.now() - before < 0.02
            ended = await s.until(one, lambda m: isinstance(m, Happening) and m.kind == "run-finished")
            assert "smoke" in ended.reason
            assert "visitor" in ended.reason
            assert all(w.latest().state is DriveState.QUICK_STOP_ACTIVE for w in s.rig.rig.winches)
            refused = await one.command(Start())
            assert "latched" in refused.says
            assert (await one.command(Shutdown())).ok

    assert serving.run(script) == 3


@pytest.mark.parametrize("after", [0.0, 0.04])
def test_an_emergency_stop_before_a_run_has_really_begun_keeps_it_from_beginning(serving, after):
    """Between "start" and the engine a stop found nothing running: it was confirmed, and the run moved all winches."""

    async def script(s):
        async with s.client("one") as one, s.client("visitor") as visitor:
            await s.begin(one)
            await s.service.clock.sleep(after)
            assert (await visitor.command(EmergencyStop(reason="smoke"))).ok
            ended = await s.until(one, lambda m: isinstance(m, Happening) and m.kind == "run-finished")
            assert "emergency stop by visitor" in ended.reason
            assert "It was at" not in ended.reason, "no step has begun"

    assert serving.run(script) == 3
    assert {drive.state for drive in serving.rig.drives} == {State.SWITCH_ON_DISABLED}


@pytest.mark.slow
def test_ten_clients_that_do_not_read_change_nothing_and_are_dropped(serving, monkeypatch):
    monkeypatch.setattr("fidim_lab.app.service.process.hub.BACKLOG", 20_000)  # beside what the system itself keeps

    async def script(s):
        deaf = []
        for _ in range(10):
            sock = socket.socket(socket.AF_UNIX)
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            sock.connect(str(s.socket))
            sock.send(encode(Hello(client="deaf")))
            deaf.append(sock)
        async with s.client(samples=False) as client:
            await s.begin(client)
            async for message in client:
                assert not isinstance(message, Status) or message.loop_late < 0.1
        for sock in deaf:
            sock.close()

    assert serving.run(script) == 0
    assert serving.service.hub.dropped == 10


def test_clients_that_say_nonsense_are_refused_and_nothing_else_happens(serving):
    async def script(s):
        async with s.client() as client:
            await s.begin(client)
            for nonsense in (b"\xff" * 100 + b"\n", b"{}\n", b"GET / HTTP/1.1\r\n\r\n", b'{"type":"command"}\n'):
                reader, writer = await asyncio.open_unix_connection(s.socket)
                writer.write(nonsense)
                said = json.loads(await reader.read())
                assert said["type"] == "refusal"
                writer.close()
            await s.until(client, lambda m: isinstance(m, Status) and m.step is not None and m.step.step == "Settle")
            await client.require(Abort(reason="enough seen"))

    assert serving.run(script) == 1


def test_the_socket_is_the_users_own(serving):
    async def script(s):
        assert stat.S_IMODE(s.socket.stat().st_mode) == 0o600
        async with s.client() as client:
            await client.take_lease()
            await client.require(Shutdown())

    assert serving.run(script) == 1


def test_tcp_needs_the_token_and_listens_on_this_computer_only(serving):
    async def script(s):
        port = await s.service.hub.listen_tcp(0, "secret")
        with pytest.raises(ServiceGoneError, match="token"):
            async with connect(port=port, token="guess"):
                pass
        async with connect(port=port, token="secret", name="far") as client:
            await client.take_lease()
            await client.require(Shutdown())
        with pytest.raises(SetupError, match="token"):
            await s.service.hub.listen_tcp(0, "")

    assert serving.run(script) == 1


def test_commands_after_the_end_say_so(serving, tmp_path):
    async def script(s):
        async with s.client() as client:
            await client.take_lease()
            await client.require(Shutdown())
            async for _ in client:
                pass
            with pytest.raises(ServiceGoneError, match="has ended"):
                await client.command(Pause())

    serving.run(script)
    with pytest.raises(SetupError, match="no service listens"):
        asyncio.run(_connect(tmp_path / "nobody"))


async def _connect(path):
    async with connect(path):
        pass
