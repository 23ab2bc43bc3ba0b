"""The history for late clients: the newest events, as they were told, and never more than one line may hold."""

import tracemalloc

import pytest

from fidim_lab.app.service.chronicle import CAPACITY, ROOM, Chronicle
from fidim_lab.app.service.codec import LINE_LIMIT, encode


@pytest.fixture
def told():
    return []


@pytest.fixture
def chronicle(told):
    times = iter(range(100_000))
    return Chronicle(lambda: next(times) / 8.0, lambda: "2026-01-01T00:00:00Z", told.append)


def step(number, **more):
    return {"kind": "step-finished", "window": f"w{number:03d}", "step": "Record", "text": "record 10 s", **more}


def test_history_is_what_was_told(chronicle, told):
    chronicle.note(**step(1, outcome="pass", values=(0.1, -2.5, 1e-9)))
    chronicle.note(kind="guard-tripped", text="tension", reason="cable 2: “slack”, 1.5 N")
    history = chronicle.history
    assert list(history.events) == told
    assert [event.number for event in history.events] == [1, 2]
    assert history.forgotten == 0


def test_the_oldest_are_forgotten_and_counted(chronicle, told):
    for number in range(CAPACITY + 25):
        chronicle.note(**step(number))
    history = chronicle.history
    assert list(history.events) == told[-CAPACITY:]
    assert history.forgotten == 25


def test_long_reasons_leave_room_for_fewer(chronicle):
    for number in range(CAPACITY):
        chronicle.note(**step(number, reason="ä" * 900))
    history = chronicle.history
    assert history.events[-1].number == CAPACITY
    assert 0.5 * ROOM < len(encode(history)) < LINE_LIMIT
    assert history.forgotten + len(history.events) == CAPACITY


def test_a_night_costs_little_memory(told):
    chronicle = Chronicle(lambda: 0.0, lambda: "2026-01-01T00:00:00Z", lambda _: None)
    tracemalloc.start()
    try:
        for number in range(CAPACITY):
            chronicle.note(**step(number, outcome="pass", values=(1.5,)))
        size, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert size / CAPACITY < 400
