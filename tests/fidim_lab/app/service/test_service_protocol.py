"""The protocol without I/O: what is taken, what is refused, in whatever pieces the bytes come."""

import errno
import json
import os
import threading
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from docs.tools.messages import messages_page
from fidim_lab.app.service.codec import LINE_LIMIT, LineDecoder, MalformedLine, encode
from fidim_lab.app.service.commands import (
    REASON,
    TO_SERVICE,
    Abort,
    AnswerPrompt,
    EmergencyStop,
    Hello,
    Pause,
    Request,
    Reset,
    Skip,
    Start,
    TakeLease,
)
from fidim_lab.app.service.latch import AT_START, CODE_LIFE, Latch
from fidim_lab.app.service.messages import TO_CLIENT, Bye, Happening, History, Question, Refusal, Welcome
from fidim_lab.app.service.process.session import ConversationStage, Lease, ServerSession
from fidim_lab.app.service.process.stop_keeper import StopKeeper
from fidim_lab.data.rigs.stop_file import Stopped, stop_path

HELLO = b'{"type":"hello","protocol":"fidim-service/1","client":"me"}\n'
ROOT = Path(__file__).parents[4]

TRANSCRIPTS = [
    (b'{"type":"command","id":1,"command":{"name":"start"}}\n', Request(id=1, command=Start())),
    (
        b'{"type":"command","id":2,"command":{"name":"pause","reason":"tea"}}\n',
        Request(id=2, command=Pause(reason="tea")),
    ),
    (b'{"type":"command","id":3,"command":{"name":"e-stop"}}\n', Request(id=3, command=EmergencyStop())),
    (
        b'{"type":"command","id":4,"command":{"name":"reset","code":"0123"}}\n',
        Request(id=4, command=Reset(code="0123")),
    ),
    (
        b'{"type":"command","id":5,"command":{"name":"answer","prompt":7,"choice":"done"}}\n',
        Request(id=5, command=AnswerPrompt(prompt=7, choice="done")),
    ),
    (b'{"type":"command","id":6,"command":{"name":"take-lease"}}\n', Request(id=6, command=TakeLease())),
]


def said(session: ServerSession, wire: bytes):
    session.add(wire)
    return list(iter(session.next, None))


@pytest.mark.parametrize(("wire", "message"), TRANSCRIPTS)
def test_the_wire_is_what_the_page_says(wire, message):
    session = ServerSession(1)
    assert said(session, HELLO) == [Hello(client="me")]
    assert said(session, wire) == [message]
    assert session.stage is ConversationStage.TALKING
    assert session.name == "me #1"


HOSTILE = "\x1b[2J\x1b]0;OWNED\x07\u202eX\nFAKE LINE" + "A" * 3000


def test_texts_of_a_client_are_printable_and_a_stop_is_never_refused_over_its_words():
    session = ServerSession(1)
    hello = json.dumps({"type": "hello", "client": HOSTILE}).encode() + b"\n"
    stop = {"type": "command", "id": 1, "command": {"name": "e-stop", "reason": HOSTILE}}
    _, request = said(session, hello + json.dumps(stop).encode() + b"\n")
    assert session.name == "\\x1b[2J\\x1b]0;OWNED\\x07\\u202eX FAKE LIN… #1"
    assert isinstance(request, Request)
    assert isinstance(request.command, EmergencyStop)
    assert request.command.reason.isprintable()
    assert len(request.command.reason) == REASON


def texts(value):
    if isinstance(value, str):
        return [value]
    parts = value.values() if isinstance(value, dict) else value if isinstance(value, list | tuple) else ()
    return [text for part in parts for text in texts(part)]


@pytest.mark.parametrize(
    "message",
    [
        Bye(says="@", exit_code=0),
        Refusal(says="@"),
        Welcome(you=1, run="@", folder="f", rig="@", windows=("i01", "@"), winches=("@",)),
        Question(number=1, kind="steady", window="@", text="@", choices=("@", "b")),
        History(events=(Happening(number=1, t=0.0, wall="", kind="e-stop", text="@", reason="@"),)),
    ],
    ids=lambda message: message.type,
)
def test_texts_of_a_service_are_printable_too(message):
    """Names of drives and markers come from other devices."""
    wire = encode(message).replace(b"@", json.dumps(HOSTILE)[1:-1].encode())
    (taken,) = LineDecoder(TO_CLIENT).receive(wire)
    assert "\\x1b[2J" in str(texts(taken.model_dump()))
    assert all(text.isprintable() for text in texts(taken.model_dump()))


def test_what_is_wrong_with_a_line_is_said_in_printable_words():
    line = json.dumps({"type": "hello", "\x1b[2J": 1}).encode() + b"\n"
    (taken,) = LineDecoder(TO_SERVICE).receive(line)
    assert isinstance(taken, MalformedLine)
    assert taken.says.isprintable()


REFUSED = [
    (b"GET / HTTP/1.1\r\n\n", "not a message"),
    (b"\xff\xfe\x00\n", "not a message"),
    (b"\n", "not a message"),
    (b"[]\n", "not a message"),
    (b'{"type":"hello","protocol":"fidim-service/2"}\n', "protocol fidim-service/1, the client fidim-service/2"),
    (b'{"type":"hello","surprise":1}\n', "surprise"),
    (b'{"type":"command","id":1,"command":{"name":"start"}}\n', "first message must be hello"),
    (HELLO + HELLO, "hello was sent twice"),
    (HELLO + b'{"type":"command","id":1,"command":{"name":"fly"}}\n', "fly"),
    (HELLO + b'{"type":"command","id":1,"command":{"name":"skip"}}\n', "reason"),
    (HELLO + b'{"type":"command","id":1,"command":{"name":"abort","reason":""}}\n', "reason"),
    (HELLO + b'{"type":"command","id":"x","command":{"name":"start"}}\n', "id"),
    (b"x" * (LINE_LIMIT + 2), "a line of more than"),
]


@pytest.mark.parametrize(("wire", "why"), REFUSED, ids=[why for _, why in REFUSED])
def test_what_is_no_message_is_refused_with_why_and_closes(wire, why):
    session = ServerSession(1)
    *_, last = said(session, wire)
    assert isinstance(last, Refusal)
    assert why in last.says
    assert session.stage is ConversationStage.CLOSED
    assert said(session, HELLO) == []


@pytest.mark.parametrize(("token", "good"), [("secret", True), ("", False), ("Secret", False), ("é", False)])
def test_a_token_is_asked_for_where_there_is_one(token, good):
    session = ServerSession(1, token="secret")
    said(session, encode(Hello(token=token)))
    assert (session.stage is ConversationStage.TALKING) is good


commands = st.one_of(
    st.builds(Pause, reason=st.text(max_size=50)),
    st.builds(Skip, reason=st.text(min_size=1, max_size=50)),
    st.builds(Abort, reason=st.text(min_size=1, max_size=50)),
    st.builds(AnswerPrompt, prompt=st.integers(), choice=st.text(max_size=20)),
)
requests = st.lists(st.builds(Request, id=st.integers(), command=commands), max_size=8)


@given(requests, st.lists(st.integers(1, 40), min_size=1))
def test_messages_come_back_whatever_pieces_they_come_in(sent, sizes):
    wire, decoder, got = b"".join(encode(m) for m in sent), LineDecoder(TO_SERVICE), []
    k = 0
    while wire:
        size = sizes[k % len(sizes)]
        got += decoder.receive(wire[:size])
        wire, k = wire[size:], k + 1
    assert got == sent


@given(st.binary(max_size=400))
def test_no_bytes_raise_and_nothing_is_taken_after_what_is_no_message(data):
    for adapter in (TO_SERVICE, TO_CLIENT):
        decoder = LineDecoder(adapter, limit=100)
        got = decoder.receive(data)
        if any(isinstance(m, MalformedLine) for m in got):
            assert isinstance(got[-1], MalformedLine)
            assert decoder.receive(HELLO) == []


@given(
    st.recursive(
        st.none() | st.booleans() | st.floats() | st.text(), lambda c: st.lists(c) | st.dictionaries(st.text(), c)
    )
)
def test_any_json_is_a_message_or_refused(value):
    (got,) = LineDecoder(TO_SERVICE).receive(json.dumps(value).encode() + b"\n")
    assert isinstance(got, MalformedLine | Hello | Request)


def test_one_commands_until_it_lets_go_or_is_overruled():
    lease = Lease()
    assert lease.take(1)
    assert lease.take(1)
    assert not lease.take(2)
    lease.release(2)
    assert lease.holder == 1
    assert lease.take(2, force=True)
    lease.release(1)
    assert lease.holder == 2
    lease.release(2)
    assert lease.take(3)


STOPPED = Stopped("ann #1", "a cable is slack", "2026-11-25T10:58:03.123+00:00")


def test_the_latch_is_latched_from_the_start_and_opens_in_two_steps_only():
    now = [0.0]
    latch = Latch(lambda: now[0])
    assert latch.latched
    assert latch.second_step("")
    code = latch.first_step()
    assert latch.second_step("wrong")
    assert latch.second_step(code), "a wrong code needs a new first step"
    code = latch.first_step()
    now[0] += CODE_LIFE + 1.0
    assert latch.second_step(code), "too old"
    code = latch.first_step()
    latch.latch(STOPPED)
    assert latch.second_step(code), "latched again since"
    assert latch.second_step(latch.first_step()) == ""
    assert not latch.latched


def test_a_stop_outlives_the_service_and_its_first_cause_stays(tmp_path):
    path, told = tmp_path / "rig.stopped.toml", []
    latch = Latch(lambda: 0.0, StopKeeper(path, told.append))
    assert latch.why == AT_START
    latch.latch(STOPPED)
    latch.latch(Stopped("bob #2", "me too", ""))
    until(path.exists)
    latch = Latch(lambda: 0.0, StopKeeper(path, told.append))
    assert latch.why == "emergency stop by ann #1: a cable is slack (2026-11-25 10:58:03 UTC)"
    assert latch.second_step(latch.first_step()) == ""
    assert not path.exists()
    assert told == []


def test_a_stop_that_its_disk_does_not_take_is_kept_elsewhere_until_it_is_undone(tmp_path):
    path, told = tmp_path / "none" / "rig.stopped.toml", []
    Latch(lambda: 0.0, StopKeeper(path, told.append)).latch(STOPPED)
    until(lambda: told)
    assert "the emergency stop is kept in " in told[0]
    assert "rig.stopped.toml: cannot be written: No such file or directory" in told[0]
    latch = Latch(lambda: 0.0, StopKeeper(path, told.append))
    assert "a cable is slack" in latch.why
    assert latch.second_step(latch.first_step()) == ""
    assert Latch(lambda: 0.0, StopKeeper(path, told.append)).why == AT_START


def test_a_stop_that_cannot_be_kept_anywhere_is_told_and_one_that_cannot_be_forgotten_stays(tmp_path, monkeypatch):
    path, told = tmp_path / "none" / "rig.stopped.toml", []
    latch = Latch(lambda: 0.0, StopKeeper(path, told.append))
    really = Path.open

    def full(self, mode="r", **more):
        if "w" in mode:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return really(self, mode, **more)

    monkeypatch.setattr(Path, "open", full)
    latch.latch(STOPPED)
    until(lambda: told)
    assert "in this service only" in told[0]
    assert "No space left on device" in told[0]
    path.mkdir(parents=True)
    assert "so the stop remains" in latch.second_step(latch.first_step())
    assert latch.latched


def test_a_stop_that_cannot_be_read_is_a_stop(tmp_path):
    path = tmp_path / "rig.stopped.toml"
    path.write_text("torn")
    assert "Delete it by hand" in Latch(lambda: 0.0, StopKeeper(path, print)).why


def test_a_rehearsal_keeps_its_stop_apart_and_a_link_to_a_rig_file_shares_it(tmp_path):
    (tmp_path / "rig.toml").touch()
    (tmp_path / "link.toml").symlink_to(tmp_path / "rig.toml")
    assert stop_path(tmp_path / "link.toml", embedded=False) == tmp_path / "rig.stopped.toml"
    assert stop_path(tmp_path / "rig.toml", embedded=True) == tmp_path / "rig.rehearsal-stopped.toml"


def until(wanted):
    for thread in threading.enumerate():
        if thread.name == "emergency stop":
            thread.join(30.0)
    assert wanted()


def test_the_page_of_messages_is_that_of_the_models():
    page = (ROOT / "docs" / "messages.md").read_text(encoding="utf-8")
    assert page == messages_page(), "python -m docs.tools.messages > docs/messages.md"
