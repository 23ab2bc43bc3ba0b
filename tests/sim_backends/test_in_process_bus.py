"""Order, re-entrancy, taps and faults of the bus in process, with small nodes of its own."""

import asyncio
import math

import pytest

from fidim_lab.errors import BusError, OurBugError
from sim_backends.bus_faults import FrameRule
from sim_backends.in_process_bus import InProcessBus


class Echo:
    """Answers identifier `hears` with `says`, and sends `says` at the times given."""

    def __init__(self, hears, says, times=()):
        self.listens = {hears}
        self.says = says
        self.times = list(times)
        self.heard = []

    @property
    def due(self):
        return self.times[0] if self.times else math.inf

    def start(self, t):
        return [(0x700 + self.says, b"\x00")]

    def receive(self, frame):
        self.heard.append((frame.id, frame.data.hex(), frame.t))
        return [(self.says, frame.data + b"!")]

    def advance(self, t):
        frames = []
        while self.times and self.times[0] <= t:
            frames.append((self.says, bytes([len(self.times)])))
            self.times.pop(0)
        return frames


@pytest.fixture
def now():
    return [0.0]


@pytest.fixture
def bus(now):
    return InProcessBus(lambda: now[0])


def listen(bus):
    frames = []
    bus.subscribe(lambda frame: frames.append((frame.id, frame.data)))
    return frames


def test_answers_are_there_when_send_returns_in_order_of_identifiers(bus, now):
    frames = listen(bus)
    for says in (0x30, 0x10, 0x20):
        bus.attach(Echo(0x80, says))
    assert [frame_id for frame_id, _ in frames] == [0x730, 0x710, 0x720]  # powered one after the other
    frames.clear()
    bus.send(0x80, b"a")
    assert frames == [(0x10, b"a!"), (0x20, b"a!"), (0x30, b"a!")]


def test_nodes_hear_each_other_but_not_themselves(bus):
    first, second = Echo(0x10, 0x11), Echo(0x11, 0x10)
    bus.attach(first)
    bus.attach(second)
    bus.rules.append(FrameRule(frozenset({0x10}), skip=1, drop=True))  # or they would talk for ever
    bus.send(0x10, b"x")
    assert first.heard == [(0x10, b"x".hex(), 0.0)]
    assert second.heard == [(0x11, b"x!".hex(), 0.0)]


def test_a_subscriber_may_send(bus):
    frames = listen(bus)
    bus.attach(Echo(0x80, 0x10))
    bus.attach(Echo(0x90, 0x20))
    depth = []

    def reply(frame):
        depth.append(frame.id)
        if frame.id == 0x10:
            bus.send(0x90, b"again")
            assert depth[-1] == 0x10  # passes later, not inside

    bus.subscribe(reply)
    frames.clear()
    bus.send(0x80, b"a")
    assert frames == [(0x10, b"a!"), (0x20, b"again!")]


def test_a_tap_sees_both_directions_once(bus, now):
    bus.attach(Echo(0x80, 0x10))
    seen = []
    bus.tap(lambda frame: seen.append((frame.t, frame.id)))
    now[0] = 1.5
    bus.send(0x80, b"")
    bus.inject(0x123, b"?")
    assert seen == [(1.5, 0x80), (1.5, 0x10), (1.5, 0x123)]


def test_advance_follows_the_times_of_all_nodes(bus):
    frames = listen(bus)
    bus.attach(Echo(0x80, 0x10, times=[0.1, 0.4]))
    bus.attach(Echo(0x80, 0x20, times=[0.2, 0.3, 0.4]))
    frames.clear()
    assert bus.due == 0.1
    bus.advance(0.45)
    assert [frame_id for frame_id, _ in frames] == [0x10, 0x20, 0x20, 0x10, 0x20]
    assert bus.due == math.inf


@pytest.mark.parametrize(
    ("rule", "expected"),
    [
        (FrameRule(frozenset({0x10}), drop=True), []),
        (FrameRule(frozenset({0x10}), skip=1, count=1, drop=True), [0, 2, 3]),
        (FrameRule(frozenset({0x10}), copies=2, count=1), [0, 0, 1, 2, 3]),
        (FrameRule(frozenset({0x11}), drop=True), [0, 1, 2, 3]),
        (FrameRule(frozenset({0x80}), skip=3, drop=True), [0, 1, 2]),  # the request, on its way to the node
    ],
)
def test_rules(bus, rule, expected):
    bus.attach(Echo(0x80, 0x10))
    frames = listen(bus)
    bus.rules.append(rule)
    for i in range(4):
        bus.send(0x80, bytes([i]))
    assert [data[0] for _, data in frames] == expected


def test_changed_and_late(bus, now):
    bus.attach(Echo(0x80, 0x10))
    frames = listen(bus)
    bus.rules = [
        FrameRule(frozenset({0x10}), count=1, change=lambda data: data[:1]),
        FrameRule(frozenset({0x10}), delay=0.2),
    ]
    bus.send(0x80, b"one")
    bus.send(0x80, b"two")
    assert frames == [(0x10, b"o")]
    assert bus.due == 0.2
    now[0] = 0.19
    bus.advance(0.19)
    assert len(frames) == 1
    now[0] = 0.21
    bus.advance(0.21)
    assert frames == [(0x10, b"o"), (0x10, b"two!")]


def test_a_cut_cable_is_silent_both_ways(bus):
    node, other = Echo(0x80, 0x10, times=[1.0]), Echo(0x10, 0x20)
    bus.attach(node)
    bus.attach(other)
    frames = listen(bus)
    bus.cut = True
    bus.send(0x80, b"a")
    bus.advance(2.0)
    assert (frames, node.heard, bus.fault) == ([], [], None)
    assert len(other.heard) == 1  # beyond the cut they hear each other
    bus.cut = False
    bus.send(0x80, b"a")
    assert frames[0] == (0x10, b"a!")


def test_bus_off_is_an_error_to_the_master(bus):
    node = Echo(0x80, 0x10, times=[1.0])
    bus.attach(node)
    frames = listen(bus)
    bus.fault = "bus-off"
    with pytest.raises(BusError, match="0x080: bus-off"):
        bus.send(0x80, b"")
    bus.advance(2.0)
    assert (frames, node.heard) == ([], [])


def test_closed_for_good_but_twice_is_no_harm(bus):
    bus.attach(Echo(0x80, 0x10))
    frames = listen(bus)
    bus.close()
    bus.close()
    with pytest.raises(BusError, match="closed"):
        bus.send(0x80, b"")
    assert frames == []


@pytest.mark.parametrize(("frame_id", "data"), [(0x800, b""), (-1, b""), (0x80, bytes(9))])
def test_no_can_frame(bus, frame_id, data):
    with pytest.raises(OurBugError, match="no classic CAN frame"):
        bus.send(frame_id, data)
    with pytest.raises(OurBugError):
        bus.inject(frame_id, data)


def test_call_runs_the_exchange_and_passes_its_error_on(bus):
    assert asyncio.run(bus.call(3, lambda: 42)) == 42

    def fails():
        raise BusError("no")

    with pytest.raises(BusError):
        asyncio.run(bus.call(3, fails))
