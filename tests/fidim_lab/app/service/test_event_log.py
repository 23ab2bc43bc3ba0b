"""The history for late clients: the newest events, as they were told, and never more than one line may hold."""

import tracemalloc

import pytest

from fidim_lab.app.service.codec import LineDecoder
from fidim_lab.app.service.messages import TO_CLIENT, History
from fidim_lab.app.service.process.event_log import CAPACITY, PIECE, ROOM, EventLog


@pytest.fixture
def told():
    return []


@pytest.fixture
def event_log(told):
    times = iter(range(100_000))
    return EventLog(lambda: next(times) / 8.0, lambda: "2026-01-01T00:00:00Z", told.append)


def history_of(event_log):
    """As a client has it once all pieces are there."""
    lines = list(event_log.history())
    pieces = LineDecoder(TO_CLIENT, limit=1 << 20).receive(b"".join(lines))
    assert [piece.more for piece in pieces] == [True] * (len(pieces) - 1) + [False]
    events = tuple(event for piece in pieces for event in piece.events)
    return History(events=events, forgotten=pieces[0].forgotten), lines


def step(number, **more):
    return {"kind": "step-finished", "window": f"w{number:03d}", "step": "Record", "text": "record 10 s", **more}


def test_nothing_has_happened_yet(event_log):
    assert history_of(event_log)[0].events == ()


def test_history_is_what_was_told(event_log, told):
    event_log.note(**step(1, outcome="pass", values=(0.1, -2.5, 1e-9)))
    event_log.note(kind="guard-tripped", text="tension", reason="cable 2: “slack”, 1.5 N")
    history, _ = history_of(event_log)
    assert list(history.events) == told
    assert [event.number for event in history.events] == [1, 2]
    assert history.forgotten == 0


def test_the_oldest_are_forgotten_and_counted(event_log, told):
    for number in range(CAPACITY + 25):
        event_log.note(**step(number))
    history, _ = history_of(event_log)
    assert list(history.events) == told[-CAPACITY:]
    assert history.forgotten == 25


def test_long_reasons_leave_room_for_fewer(event_log):
    for number in range(CAPACITY):
        event_log.note(**step(number, reason="ä" * 900))
    history, lines = history_of(event_log)
    assert history.events[-1].number == CAPACITY
    assert 0.5 * ROOM < sum(map(len, lines)) < 1.1 * ROOM
    assert max(map(len, lines)) < PIECE + 4000
    assert history.forgotten + len(history.events) == CAPACITY


def test_a_night_costs_little_memory(told):
    event_log = EventLog(lambda: 0.0, lambda: "2026-01-01T00:00:00Z", lambda _: None)
    tracemalloc.start()
    try:
        for number in range(CAPACITY):
            event_log.note(**step(number, outcome="pass", values=(1.5,)))
        size, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert size / CAPACITY < 400
