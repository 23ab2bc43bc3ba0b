"""What the server measures and when its packets are due, read from its own lines of text without any driver."""

import asyncio

import numpy as np
import pytest

from sim_backends.mocap.encoders import TextEncoder
from sim_backends.mocap.faults import During, Faults, Freeze, Jump, Occlusion
from sim_backends.mocap.server import MocapServer, ServerFeed, StreamTiming

PLACE = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])


class JumpingClock:
    """Sleeping is all that makes it go on."""

    def __init__(self) -> None:
        self.t = 1000.0

    def now(self) -> float:
        return self.t

    async def sleep(self, seconds: float) -> None:
        self.t += seconds


def make(
    timing: StreamTiming | None = None, faults: Faults | None = None, *, noise: float = 0.0, seed: int = 1
) -> MocapServer:
    encoder = TextEncoder(checksum=False, digits=9)
    rng = np.random.default_rng(seed)
    return MocapServer(
        lambda t: PLACE, encoder, rng, timing=timing or StreamTiming(100.0), noise=noise, faults=faults or Faults()
    )


def receive(server: MocapServer, count: int) -> list[tuple[float, bytes]]:
    async def main() -> list[tuple[float, bytes]]:
        clock = JumpingClock()
        feed = ServerFeed(server, clock)
        await feed.open()
        packets: list[tuple[float, bytes]] = []
        for _ in range(count):
            due, data = await feed.receive()
            assert due == pytest.approx(clock.now(), abs=1e-8)
            packets.append((due, data))
        await feed.close()
        return packets

    return asyncio.run(main())


def numbers(packets: list[tuple[float, bytes]]) -> list[int]:
    return [int(data.split(b",")[0]) for _, data in packets]


def markers(packets: list[tuple[float, bytes]]) -> np.ndarray:
    rows = [[float(field) if field.strip() else np.nan for field in data.split(b",")[1:]] for _, data in packets]
    return np.array(rows).reshape(len(rows), 2, 3)


def test_packets_come_at_the_rate_with_the_latency_and_drift() -> None:
    packets = receive(make(StreamTiming(100.0, drift=1e-3, latency=0.037, first_number=500)), 300)
    assert numbers(packets) == list(range(500, 800))
    expected = 1000.0 + np.arange(1, 301) * 1.001 / 100.0 + 0.037
    assert np.allclose([due for due, _ in packets], expected, atol=1e-9)


def test_truth_is_asked_at_the_exposure() -> None:
    asked: list[float] = []

    def truth(t: float) -> np.ndarray:
        asked.append(t)
        return PLACE

    server = MocapServer(truth, TextEncoder(), np.random.default_rng(0), StreamTiming(100.0, latency=0.05))
    receive(server, 10)
    assert np.allclose(asked[:10], 1000.0 + np.arange(1, 11) / 100.0)


def test_noise_has_the_stated_size() -> None:
    error = markers(receive(make(noise=1e-3), 4000)) - PLACE
    assert np.std(error, axis=0) == pytest.approx(1e-3, rel=0.05)
    assert np.mean(error, axis=0) == pytest.approx(0.0, abs=6e-5)


def test_faults_of_the_way_change_no_noise() -> None:
    clean = dict(receive_by_number(make(noise=1e-3)))
    faults = Faults(lost=0.2, doubled=0.1)
    rough = dict(receive_by_number(make(StreamTiming(100.0, jitter=0.01), faults, noise=1e-3)))
    common = set(clean) & set(rough)
    assert 100 < len(common) < len(clean)
    assert all(clean[number] == rough[number] for number in common)


def receive_by_number(server: MocapServer) -> list[tuple[int, bytes]]:
    return [(int(data.split(b",")[0]), data) for _, data in receive(server, 200)]


def test_jitter_delays_and_keeps_the_order() -> None:
    packets = receive(make(StreamTiming(100.0, latency=0.004, jitter=0.002, spikes=0.05)), 2000)
    assert numbers(packets) == list(range(1, 2001))
    delays = np.array([due for due, _ in packets]) - 1000.0 - np.arange(1, 2001) / 100.0 - 0.004
    assert delays.min() > -1e-9
    assert 0.002 < delays.mean() < 0.004
    assert delays.max() > 0.01


def test_hidden_jumped_frozen_and_silent() -> None:
    faults = Faults(
        occlusions=(Occlusion(During(0.1, 0.2), marker=1),),
        jumps=(Jump(During(0.3, 0.4), (0.0, 0.5, 0.0)),),
        freezes=(Freeze(During(0.5, 0.6)),),
        silences=(During(0.7, 0.8),),
    )
    packets = receive(make(faults=faults, noise=1e-3), 90)
    assert numbers(packets) == [*range(1, 71), *range(81, 101)]
    seen = markers(packets)
    hidden = np.isnan(seen[:, 1]).all(axis=1)
    assert np.flatnonzero(hidden).tolist() == list(range(10, 20))
    assert np.flatnonzero(np.abs(seen[:, 0, 1] - 2.0) > 0.1).tolist() == list(range(30, 40))
    repeated = (np.diff(seen[:, 0], axis=0) == 0.0).all(axis=1)
    assert np.flatnonzero(repeated).tolist() == list(range(49, 59))


@pytest.mark.parametrize("fault", ["lost", "doubled", "torn", "garbled"])
def test_faults_come_as_often_as_asked(fault: str) -> None:
    server = make(faults=Faults(**{fault: 0.1}))
    for index in range(3000):
        server.expose(index, 0.0)
    assert server.damage.done[fault] == pytest.approx(300, abs=60)
    assert set(server.damage.done) == {fault}


def test_the_same_seed_gives_the_same_bytes_at_the_same_times() -> None:
    faults = Faults(lost=0.1, doubled=0.1, torn=0.1, garbled=0.1)
    timing = StreamTiming(100.0, jitter=0.002)
    assert receive(make(timing, faults, noise=1e-3), 300) == receive(make(timing, faults, noise=1e-3), 300)
    assert receive(make(timing, faults, noise=1e-3, seed=2), 300) != receive(make(timing, faults, noise=1e-3), 300)
