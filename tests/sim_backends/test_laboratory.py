"""The simulated laboratory: one world, moved on by whoever looks at it."""

from pathlib import Path

import numpy as np
import pytest

from drivers.cia402.dictionary import GENERIC_EDS
from fidim_lab.data.records import Robot
from sim_backends.drive.axis import ShaftMotion
from sim_backends.drive.axis.profile import standing
from sim_backends.laboratory import DrumGeometry, Laboratory
from sim_backends.mocap.encoders import TextEncoder
from sim_backends.plant.world import make_world

LENGTHS = np.array([1.35, 1.35, 1.45, 1.45])


class HandClock:
    """Time that a test sets."""

    def __init__(self) -> None:
        self.t = 5.0

    def now(self) -> float:
        return self.t


@pytest.fixture
def clock() -> HandClock:
    return HandClock()


@pytest.fixture
def laboratory(irma4: Robot, clock: HandClock) -> Laboratory:
    world = make_world(irma4, np.random.default_rng(1), body=irma4.nominal)
    return Laboratory(irma4, world, LENGTHS, np.random.default_rng(2), clock.now)


def newton(laboratory: Laboratory, robot: Robot) -> np.ndarray:
    assert robot.winches is not None
    return np.array(
        [
            -drum.direction * shaft.load_current * winch.newton_per_ampere
            for drum, shaft, winch in zip(laboratory.drums, laboratory.shafts, robot.winches, strict=True)
        ]
    )


def test_currents_carry_the_platform(laboratory: Laboratory, irma4: Robot, clock: HandClock) -> None:
    found = []
    for _ in range(200):
        clock.t += 0.01
        found.append(newton(laboratory, irma4))
    np.testing.assert_allclose(np.mean(found, axis=0), laboratory.plant.tensions, atol=0.6)
    assert laboratory.plant.tensions.min() > 20.0


def test_asking_for_a_load_lets_time_pass(laboratory: Laboratory, clock: HandClock) -> None:
    clock.t += 0.25
    _ = laboratory.shafts[2].load_current
    assert laboratory.plant.t == pytest.approx(0.25)
    laboratory.advance(5.1)  # the past stays as it was
    assert laboratory.plant.t == pytest.approx(0.25)


def test_a_drum_that_turns_moves_the_marker(laboratory: Laboratory, clock: HandClock) -> None:
    before = laboratory.plant.markers()[0].copy()
    drum, shaft = laboratory.drums[0], laboratory.shafts[0]
    counts = -drum.direction * 0.02 / drum.metres_per_count  # 20 mm wound in
    steps = 200
    for k in range(1, steps + 1):
        clock.t = 5.0 + 0.01 * k
        shaft.follow(clock.t, standing(counts * k / steps))
    laboratory.advance(8.0)
    np.testing.assert_allclose(laboratory.plant.encoder_lengths(), LENGTHS - [0.02, 0, 0, 0], atol=1e-9)
    moved = laboratory.plant.markers()[0] - before
    assert np.linalg.norm(moved) > 0.005


def test_half_of_the_drums_turn_the_other_way(laboratory: Laboratory) -> None:
    assert [drum.direction for drum in laboratory.drums] == [1, -1, 1, -1]
    assert all(shaft.motion(0.0) == ShaftMotion(0.0) for shaft in laboratory.shafts)


def test_the_same_seed_gives_the_same_packets(irma4: Robot) -> None:
    def packets(seed: int) -> list[bytes]:
        clock = HandClock()
        world = make_world(irma4, np.random.default_rng(1))
        laboratory = Laboratory(irma4, world, LENGTHS, np.random.default_rng(seed), clock.now)
        server = laboratory.mocap_server(TextEncoder(), 100.0)
        return [piece.data for k in range(20) for piece in server.expose(k, 5.0)]

    assert packets(3) == packets(3)
    assert packets(3) != packets(4)


def test_drives_read_the_shipped_dictionary(laboratory: Laboratory) -> None:
    assert Path(GENERIC_EDS).is_file()
    assert [drive.node_id for drive in laboratory.drives(GENERIC_EDS)] == [1, 2, 3, 4]


def test_within_its_grain_a_look_at_a_current_moves_nothing(irma4: Robot, clock: HandClock) -> None:
    world = make_world(irma4, np.random.default_rng(1), body=irma4.nominal)
    laboratory = Laboratory(irma4, world, LENGTHS, np.random.default_rng(2), clock.now, grain=0.005)
    before = laboratory.plant.t
    clock.t += 0.004
    _ = laboratory.shafts[0].load_current
    assert laboratory.plant.t == before
    clock.t += 0.002
    _ = laboratory.shafts[0].load_current
    assert laboratory.plant.t == pytest.approx(before + 0.006)


def test_drums_of_a_rig_file_begin_at_its_counts(irma4: Robot, clock: HandClock) -> None:
    world = make_world(irma4, np.random.default_rng(1), body=irma4.nominal)
    drums = [DrumGeometry(1.0, direction, 5e-6) for direction in (1, -1, 1, -1)]
    laboratory = Laboratory(irma4, world, LENGTHS, np.random.default_rng(2), clock.now, drums=drums)
    for shaft, drum, length in zip(laboratory.shafts, drums, LENGTHS, strict=True):
        shaft.follow(-np.inf, standing(drum.direction * (length - drum.home_length) / drum.metres_per_count))
    clock.t += 0.1
    laboratory.advance(clock.t)
    np.testing.assert_allclose(laboratory.plant.encoder_lengths(), LENGTHS, atol=1e-9)
    assert laboratory.plant.tensions.min() > 20.0
